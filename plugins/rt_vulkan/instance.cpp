// SPDX-License-Identifier: Apache-2.0
#define VOLK_IMPLEMENTATION
#include "instance.hpp"

#include "layout.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>
#include <link.h>
#include <set>

namespace rt_vulkan {
namespace {

using arhost::Failure;

constexpr const char *validation_layer = "VK_LAYER_KHRONOS_validation";
constexpr const char *install_driver = "install the GPU's driver or Mesa's (Debian: mesa-vulkan-drivers), or use "
                                       "rt_embree";

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT *data, void *host) {
    static_cast<const arhost::Host *>(host)->error(std::string("Vulkan validation: ") + data->pMessage);
    return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messenger_info(arhost::Host &host) {
    return {.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT,
            .messageSeverity =
                VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT,
            .messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT,
            .pfnUserCallback = on_message,
            .pUserData = &host};
}

std::string lower(std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
    return text;
}

std::string list_of(const std::vector<PhysicalDevice> &devices) {
    std::string text;
    for (std::size_t i = 0; i < devices.size(); ++i)
        text += (i ? ", " : "") + std::to_string(i) + " '" + devices[i].name + "' (" + devices[i].uuid + ")";
    return text;
}

const char *name_of(VkResult result) {
    switch (result) {
#define RT_VULKAN_NAME(name)                                                                                         \
    case name:                                                                                                       \
        return #name;
        RT_VULKAN_NAME(VK_ERROR_DEVICE_LOST)
        RT_VULKAN_NAME(VK_ERROR_OUT_OF_HOST_MEMORY)
        RT_VULKAN_NAME(VK_ERROR_OUT_OF_DEVICE_MEMORY)
        RT_VULKAN_NAME(VK_ERROR_INITIALIZATION_FAILED)
        RT_VULKAN_NAME(VK_ERROR_MEMORY_MAP_FAILED)
        RT_VULKAN_NAME(VK_ERROR_LAYER_NOT_PRESENT)
        RT_VULKAN_NAME(VK_ERROR_EXTENSION_NOT_PRESENT)
        RT_VULKAN_NAME(VK_ERROR_FEATURE_NOT_PRESENT)
        RT_VULKAN_NAME(VK_ERROR_INCOMPATIBLE_DRIVER)
        RT_VULKAN_NAME(VK_ERROR_TOO_MANY_OBJECTS)
        RT_VULKAN_NAME(VK_ERROR_FRAGMENTED_POOL)
        RT_VULKAN_NAME(VK_ERROR_UNKNOWN)
        RT_VULKAN_NAME(VK_ERROR_OUT_OF_POOL_MEMORY)
        RT_VULKAN_NAME(VK_ERROR_FRAGMENTATION)
#undef RT_VULKAN_NAME
    default:
        return "unknown error";
    }
}

// If an environment variable restricts the drivers that the loader looks for, returns a hint for error messages that
// names the variable and its value.
std::string driver_variable_hint() {
    for (const char *variable : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
        if (const char *files = std::getenv(variable))
            return std::string("; ") + variable + " is '" + files +
                   "', so the loader looks for these drivers only; allow the plugin to read the files with 'reads'";
    return "";
}

// Returns the paths of all libraries that this process has loaded.
std::set<std::string> loaded_libraries() {
    std::set<std::string> paths;
    dl_iterate_phdr(
        [](dl_phdr_info *library, std::size_t, void *into) {
            static_cast<std::set<std::string> *>(into)->insert(library->dlpi_name);
            return 0;
        },
        &paths);
    return paths;
}

// Keeps newly loaded libraries in memory until the process ends. `before`: the libraries that were already loaded.
void keep_new_libraries(const std::set<std::string> &before) {
    for (const std::string &path : loaded_libraries())
        if (!before.contains(path))
            if (void *library = dlopen(path.c_str(), RTLD_LAZY | RTLD_NOLOAD | RTLD_NODELETE))
                dlclose(library);
}

// Returns a device's preference for `auto`: higher is better, and −1 means unusable.
int rank(const PhysicalDevice &device) {
    if (!missing_requirement(device).empty())
        return -1;
    switch (device.properties.deviceType) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
        return 4;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
        return 3;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
        return 2;
    case VK_PHYSICAL_DEVICE_TYPE_CPU:
        return 1;
    default:
        return 0;
    }
}

// Adds those hardware paths to `device` whose extensions and features it supports, and sets their limits.
void add_tracing(PhysicalDevice &device, bool has_query, bool has_pipeline) {
    if (!has_query && !has_pipeline)
        return;
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR};
    VkPhysicalDeviceRayQueryFeaturesKHR query{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR,
                                              .pNext = has_pipeline ? &pipeline : nullptr};
    VkPhysicalDeviceAccelerationStructureFeaturesKHR structures{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR,
        .pNext = has_query ? static_cast<void *>(&query) : &pipeline};
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES, .pNext = &structures};
    VkPhysicalDeviceFeatures2 features{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2, .pNext = &addresses};
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipeline_limits{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR};
    VkPhysicalDeviceAccelerationStructurePropertiesKHR limits{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR,
        .pNext = has_pipeline ? &pipeline_limits : nullptr};
    VkPhysicalDeviceProperties2 properties{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &limits};
    vkGetPhysicalDeviceFeatures2(device.handle, &features);
    vkGetPhysicalDeviceProperties2(device.handle, &properties);
    if (!addresses.bufferDeviceAddress || !structures.accelerationStructure)
        return;
    if (query.rayQuery)
        device.paths.push_back(Path::query);
    if (pipeline.rayTracingPipeline)
        device.paths.push_back(Path::pipeline);
    device.tracing = {limits.maxInstanceCount,
                      limits.maxPrimitiveCount,
                      limits.minAccelerationStructureScratchOffsetAlignment,
                      pipeline_limits.shaderGroupHandleSize,
                      pipeline_limits.shaderGroupHandleAlignment,
                      pipeline_limits.shaderGroupBaseAlignment};
}

// Whether host memory can be the destination of image copies.
bool imports_host_memory(VkPhysicalDevice device) {
    const VkPhysicalDeviceExternalBufferInfo buffer{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO,
                                                    .usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                                                    .handleType =
                                                        VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT};
    VkExternalBufferProperties properties{.sType = VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES};
    vkGetPhysicalDeviceExternalBufferProperties(device, &buffer, &properties);
    const VkExternalMemoryFeatureFlags features = properties.externalMemoryProperties.externalMemoryFeatures;
    return (features & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) &&
           !(features & VK_EXTERNAL_MEMORY_FEATURE_DEDICATED_ONLY_BIT);
}

PhysicalDevice inspect(VkPhysicalDevice handle) {
    std::uint32_t extension_count = 0;
    vkEnumerateDeviceExtensionProperties(handle, nullptr, &extension_count, nullptr);
    std::vector<VkExtensionProperties> extensions(extension_count);
    vkEnumerateDeviceExtensionProperties(handle, nullptr, &extension_count, extensions.data());
    const auto has = [&](const char *name) {
        return std::any_of(extensions.begin(), extensions.end(), [&](const VkExtensionProperties &extension) {
            return !std::strcmp(extension.extensionName, name);
        });
    };
    PhysicalDevice device{};
    device.handle = handle;
    device.imports_host_memory = has(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME) && imports_host_memory(handle);
    VkPhysicalDeviceExternalMemoryHostPropertiesEXT import{
        .sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT};
    VkPhysicalDeviceIDProperties id{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES,
                                    .pNext = device.imports_host_memory ? &import : nullptr};
    VkPhysicalDeviceProperties2 properties{.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2, .pNext = &id};
    vkGetPhysicalDeviceProperties2(handle, &properties);
    device.name = properties.properties.deviceName;
    device.uuid = hexadecimal(id.deviceUUID);
    device.properties = properties.properties;
    device.import_alignment = import.minImportedHostPointerAlignment;
    const bool has_structures = properties.properties.apiVersion >= VK_API_VERSION_1_2 &&
                                has(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) &&
                                has(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME);
    add_tracing(device, has_structures && has(VK_KHR_RAY_QUERY_EXTENSION_NAME),
                has_structures && has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME));

    std::uint32_t family_count = 0;
    vkGetPhysicalDeviceQueueFamilyProperties(handle, &family_count, nullptr);
    std::vector<VkQueueFamilyProperties> families(family_count);
    vkGetPhysicalDeviceQueueFamilyProperties(handle, &family_count, families.data());
    // Prefers a queue family without graphics, because an image that takes long would delay the desktop's windows.
    const auto find_compute = [&](VkQueueFlags excluded) {
        return std::find_if(families.begin(), families.end(), [excluded](const VkQueueFamilyProperties &family) {
            return family.queueFlags & VK_QUEUE_COMPUTE_BIT && !(family.queueFlags & excluded);
        });
    };
    auto family = find_compute(VK_QUEUE_GRAPHICS_BIT);
    if (family == families.end())
        family = find_compute(0);
    device.queue_family = VK_QUEUE_FAMILY_IGNORED;
    if (family != families.end()) {
        device.queue_family = static_cast<std::uint32_t>(family - families.begin());
        device.timestamp_bits = family->timestampValidBits;
    }
    return device;
}

} // namespace

std::string hexadecimal(const std::uint8_t (&bytes)[VK_UUID_SIZE]) {
    std::string text;
    for (const std::uint8_t byte : bytes)
        for (const int shift : {4, 0})
            text += "0123456789abcdef"[byte >> shift & 15];
    return text;
}

std::string missing_requirement(const PhysicalDevice &device) {
    constexpr std::uint32_t buffers_needed = binding_count - 1; // all but the frame, which is a uniform buffer
    const std::uint32_t buffers = device.properties.limits.maxPerStageDescriptorStorageBuffers;
    if (device.properties.apiVersion < VK_API_VERSION_1_1)
        return "supports Vulkan 1.0 only; 1.1 is required";
    if (device.queue_family == VK_QUEUE_FAMILY_IGNORED)
        return "has no compute queue";
    if (buffers < buffers_needed)
        return "supports " + std::to_string(buffers) + " storage buffers per stage; " +
               std::to_string(buffers_needed) + " are required";
    return "";
}

const char *name_of(Path path) {
    return path == Path::plain ? "plain" : path == Path::query ? "query" : "pipeline";
}

std::string list_of(const std::vector<Path> &paths) {
    std::string text;
    for (const Path path : paths)
        text += (text.empty() ? "" : ", ") + std::string(name_of(path));
    return text;
}

void check(VkResult result, const char *what) {
    if (result >= 0)
        return;
    const std::string text = std::string(what) + ": Vulkan reports ";
    const std::string name = std::string(" (") + name_of(result) + ", " + std::to_string(result) + ")";
    switch (result) {
    case VK_ERROR_DEVICE_LOST:
        throw Failure(ARHOST_STATUS_ERROR_DEVICE_LOST, text + "that the device is lost" + name);
    case VK_ERROR_OUT_OF_HOST_MEMORY:
        throw Failure(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, text + "that the host is out of memory" + name);
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
        throw Failure(ARHOST_STATUS_ERROR_OUT_OF_MEMORY, text + "that the device is out of memory" + name +
                                                             "; use smaller meshes and textures, or rt_embree");
    case VK_ERROR_INITIALIZATION_FAILED:
    case VK_ERROR_EXTENSION_NOT_PRESENT:
    case VK_ERROR_FEATURE_NOT_PRESENT:
    case VK_ERROR_INCOMPATIBLE_DRIVER:
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      text + "that this is unsupported" + name +
                          "; check that the driver's device files (/dev/dri, /dev/nvidia*) exist and may be opened, "
                          "or use another device or rt_embree");
    default:
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL,
                      text + "an error" + name + "; update the driver, or use another device or rt_embree");
    }
}

void Instance::CloseLibrary::operator()(void *library) const {
    dlclose(library);
}

Instance::Instance(const arhost::Host &host, bool validate, const std::string &loader)
    : host_(host), library_(dlopen(loader.c_str(), RTLD_NOW | RTLD_LOCAL)) {
    if (!library_)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, std::string("no Vulkan loader: ") + dlerror() +
                                                           "; install it (Debian: libvulkan1), or use rt_embree");
    const auto get = reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library_.get(), "vkGetInstanceProcAddr"));
    if (!get)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      loader + " is not a Vulkan loader: vkGetInstanceProcAddr is missing");
    volkInitializeCustom(get);
    create(validate);
    // volk keeps instance functions in global variables. Several instances can share them, because the loader returns
    // the same functions for all instances, except for functions of extensions.
    volkLoadInstanceOnly(instance_);
    if (!validate)
        return;
    const VkDebugUtilsMessengerCreateInfoEXT info = messenger_info(host_);
    destroy_messenger_ = vkDestroyDebugUtilsMessengerEXT;
    if (!vkCreateDebugUtilsMessengerEXT ||
        vkCreateDebugUtilsMessengerEXT(instance_, &info, nullptr, &messenger_) != VK_SUCCESS) {
        vkDestroyInstance(instance_, nullptr);
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "Vulkan's validation layers cannot be made to report messages");
    }
}

Instance::~Instance() {
    if (messenger_)
        destroy_messenger_(instance_, messenger_, nullptr);
    vkDestroyInstance(instance_, nullptr);
}

void Instance::create(bool validate) {
    if (validate) {
        std::uint32_t count = 0;
        vkEnumerateInstanceLayerProperties(&count, nullptr);
        std::vector<VkLayerProperties> layers(count);
        vkEnumerateInstanceLayerProperties(&count, layers.data());
        if (std::none_of(layers.begin(), layers.end(), [](const VkLayerProperties &layer) {
                return !std::strcmp(layer.layerName, validation_layer);
            }))
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                          "option 'validate': Vulkan's validation layers are not installed (Debian: "
                          "vulkan-validationlayers); install them or omit the option");
    }
    if (!vkEnumerateInstanceVersion) // exists since Vulkan 1.1
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan loader supports version 1.0 only; install one for 1.1 or later");
    const VkApplicationInfo application{.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO,
                                        .pApplicationName = "arhost",
                                        .apiVersion = VK_API_VERSION_1_2}; // the highest version used
    // Receives messages of vkCreateInstance.
    const VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(host_);
    const VkValidationFeatureEnableEXT feature = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    const VkValidationFeaturesEXT features{.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT,
                                           .pNext = &messenger,
                                           .enabledValidationFeatureCount = 1,
                                           .pEnabledValidationFeatures = &feature};
    const char *const extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
    VkInstanceCreateInfo info{.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO, .pApplicationInfo = &application};
    if (validate) {
        info.pNext = &features;
        info.enabledLayerCount = 1;
        info.ppEnabledLayerNames = &validation_layer;
        info.enabledExtensionCount = 2;
        info.ppEnabledExtensionNames = extensions;
    }
    const std::set<std::string> before = loaded_libraries();
    const VkResult result = vkCreateInstance(&info, nullptr, &instance_);
    keep_new_libraries(before); // NVIDIA's driver 580 fails to load again after some ten unloads
    if (result == VK_ERROR_INCOMPATIBLE_DRIVER || result == VK_ERROR_INITIALIZATION_FAILED)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string("no Vulkan driver: ") + install_driver + driver_variable_hint());
    if (result == VK_ERROR_LAYER_NOT_PRESENT || (validate && result == VK_ERROR_EXTENSION_NOT_PRESENT))
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "option 'validate': Vulkan's validation layers cannot be loaded; reinstall them (Debian: "
                      "vulkan-validationlayers) or omit the option");
    if (result == VK_ERROR_OUT_OF_HOST_MEMORY) // loaders also return this code for damaged manifests
        throw Failure(
            ARHOST_STATUS_ERROR_UNSUPPORTED,
            "Vulkan cannot be started (VK_ERROR_OUT_OF_HOST_MEMORY): either memory is exhausted, or a driver's or "
            "layer's manifest is damaged; check /usr/share/vulkan, /etc/vulkan and the folders in VK_LAYER_PATH, or "
            "use rt_embree" +
                driver_variable_hint());
    check(result, "creating a Vulkan instance");
}

std::vector<PhysicalDevice> Instance::devices() const {
    std::uint32_t count = 0;
    VkResult result = vkEnumeratePhysicalDevices(instance_, &count, nullptr);
    std::vector<VkPhysicalDevice> handles(count);
    if (result == VK_SUCCESS && count > 0)
        result = vkEnumeratePhysicalDevices(instance_, &count, handles.data());
    if (result == VK_ERROR_INITIALIZATION_FAILED || (result == VK_SUCCESS && count == 0))
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string("no Vulkan device: ") + install_driver + driver_variable_hint());
    check(result, "listing the Vulkan devices");
    handles.resize(count);
    std::vector<PhysicalDevice> devices(count);
    std::transform(handles.begin(), handles.end(), devices.begin(), inspect);
    return devices;
}

const PhysicalDevice &choose_device(const std::vector<PhysicalDevice> &devices, const std::string &wanted) {
    if (wanted == "auto")
        return *std::max_element(devices.begin(), devices.end(),
                                 [](const PhysicalDevice &a, const PhysicalDevice &b) { return rank(a) < rank(b); });
    const auto reject = [&](const std::string &why) {
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                      "option 'device': " + why + " '" + wanted + "'; available: " + list_of(devices) +
                          "; use a number, a UUID, a unique part of a name, or 'auto'");
    };
    std::string uuid = lower(wanted);
    std::erase(uuid, '-');
    // `exact`: matches by number, UUID or whole name; `partial`: matches by a part of the name.
    std::vector<const PhysicalDevice *> exact, partial;
    for (std::size_t i = 0; i < devices.size(); ++i) {
        const std::string name = lower(devices[i].name);
        if (wanted == std::to_string(i) || devices[i].uuid == uuid || name == lower(wanted))
            exact.push_back(&devices[i]);
        else if (!wanted.empty() && name.find(lower(wanted)) != std::string::npos)
            partial.push_back(&devices[i]);
    }
    const auto &matches = exact.empty() ? partial : exact;
    if (matches.size() > 1)
        reject("more than one device matches");
    if (matches.empty())
        reject("no device matches");
    return *matches[0];
}

std::vector<Path> choose_paths(const PhysicalDevice &device, const std::string &wanted) {
    // On a CPU device, the driver's acceleration structures are also in software, and slower than `plain`
    // (README.md).
    if (wanted == "auto" && device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU)
        return {Path::plain};
    if (wanted == "auto")
        return {device.paths.rbegin(), device.paths.rend()};
    for (const Path path : device.paths)
        if (wanted == name_of(path))
            return {path};
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "option 'path': the Vulkan device '" + device.name + "' does not support '" + wanted +
                      "'; it supports " + list_of(device.paths) + "; use one of these, 'auto', or another device");
}

} // namespace rt_vulkan
