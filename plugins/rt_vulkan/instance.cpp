// SPDX-License-Identifier: Apache-2.0
#include "instance.hpp"

#include "layout.hpp"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <cstring>
#include <dlfcn.h>

namespace rt_vulkan {
namespace {

using arhost::Failure;

constexpr const char *validation_layer = "VK_LAYER_KHRONOS_validation";
constexpr const char *get_driver = "install the GPU's driver or Mesa's (Debian: mesa-vulkan-drivers), or use "
                                   "rt_embree";

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT *data, void *host) {
    static_cast<const arhost::Host *>(host)->error(std::string("Vulkan validation: ") + data->pMessage);
    return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messenger_info(arhost::Host &host) {
    VkDebugUtilsMessengerCreateInfoEXT info{};
    info.sType = VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT;
    info.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
    info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    info.pfnUserCallback = on_message;
    info.pUserData = &host;
    return info;
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
        return "an error without a name";
    }
}

// "; VK_DRIVER_FILES is …" where a variable tells the loader which drivers there are.
std::string told_by_environment() {
    for (const char *variable : {"VK_DRIVER_FILES", "VK_ICD_FILENAMES"})
        if (const char *files = std::getenv(variable))
            return std::string("; ") + variable + " is '" + files +
                   "': only drivers that these files name are looked for, and in the sandbox where 'reads' lists "
                   "them";
    return "";
}

// The better, the higher.
int rank(const PhysicalDevice &device) {
    if (!what_it_lacks(device).empty())
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

// The paths by the device's own trees, where it has the extensions for them.
void add_tracing(const InstanceFunctions &from, PhysicalDevice &device, bool may_query, bool may_have_pipeline) {
    if (!may_query && !may_have_pipeline)
        return;
    VkPhysicalDeviceRayTracingPipelineFeaturesKHR pipeline{};
    pipeline.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_FEATURES_KHR;
    VkPhysicalDeviceRayQueryFeaturesKHR query{};
    query.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_QUERY_FEATURES_KHR;
    VkPhysicalDeviceAccelerationStructureFeaturesKHR trees{};
    trees.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_FEATURES_KHR;
    VkPhysicalDeviceBufferDeviceAddressFeatures addresses{};
    addresses.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_BUFFER_DEVICE_ADDRESS_FEATURES;
    VkPhysicalDeviceFeatures2 features{};
    features.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
    VkPhysicalDeviceRayTracingPipelinePropertiesKHR pipeline_limits{};
    pipeline_limits.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_RAY_TRACING_PIPELINE_PROPERTIES_KHR;
    VkPhysicalDeviceAccelerationStructurePropertiesKHR limits{};
    limits.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ACCELERATION_STRUCTURE_PROPERTIES_KHR;
    VkPhysicalDeviceProperties2 properties{};
    properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
    features.pNext = &addresses;
    addresses.pNext = &trees;
    properties.pNext = &limits;
    if (may_query)
        trees.pNext = &query;
    if (may_have_pipeline) {
        query.pNext = &pipeline;
        if (!may_query)
            trees.pNext = &pipeline;
        limits.pNext = &pipeline_limits;
    }
    from.vkGetPhysicalDeviceFeatures2(device.handle, &features);
    from.vkGetPhysicalDeviceProperties2(device.handle, &properties);
    if (!addresses.bufferDeviceAddress || !trees.accelerationStructure)
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

// Whether what images are copied to can be memory of the host's.
bool imports_host_memory(const InstanceFunctions &from, VkPhysicalDevice device) {
    VkPhysicalDeviceExternalBufferInfo buffer{};
    buffer.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_BUFFER_INFO;
    buffer.usage = VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    buffer.handleType = VK_EXTERNAL_MEMORY_HANDLE_TYPE_HOST_ALLOCATION_BIT_EXT;
    VkExternalBufferProperties properties{};
    properties.sType = VK_STRUCTURE_TYPE_EXTERNAL_BUFFER_PROPERTIES;
    from.vkGetPhysicalDeviceExternalBufferProperties(device, &buffer, &properties);
    const VkExternalMemoryFeatureFlags can = properties.externalMemoryProperties.externalMemoryFeatures;
    return (can & VK_EXTERNAL_MEMORY_FEATURE_IMPORTABLE_BIT) &&
           !(can & VK_EXTERNAL_MEMORY_FEATURE_DEDICATED_ONLY_BIT);
}

} // namespace

std::string hexadecimal(const std::uint8_t (&bytes)[VK_UUID_SIZE]) {
    std::string text;
    for (const std::uint8_t byte : bytes)
        for (const int shift : {4, 0})
            text += "0123456789abcdef"[byte >> shift & 15];
    return text;
}

std::string what_it_lacks(const PhysicalDevice &device) {
    constexpr std::uint32_t buffers_needed = binding_count - 1; // but for the frame
    const std::uint32_t buffers = device.properties.limits.maxPerStageDescriptorStorageBuffers;
    if (device.properties.apiVersion < VK_API_VERSION_1_1)
        return "knows Vulkan 1.0 only, and 1.1 is needed";
    if (device.queue_family == VK_QUEUE_FAMILY_IGNORED)
        return "can't compute";
    if (buffers < buffers_needed)
        return "reads " + std::to_string(buffers) + " buffers at once, and " + std::to_string(buffers_needed) +
               " are needed";
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
                      text + "that it can't" + name +
                          "; look whether the driver's devices (/dev/dri, /dev/nvidia*) are "
                          "there and may be opened, or use another device or rt_embree");
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
    get_ = reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(library_.get(), "vkGetInstanceProcAddr"));
    if (!get_)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      loader + " is no Vulkan loader: it lacks vkGetInstanceProcAddr");
    create(validate);
#define RT_VULKAN_LOAD(name)                                                                                         \
    functions_.name = reinterpret_cast<PFN_##name>(get_(instance_, #name));                                          \
    if (!functions_.name)                                                                                            \
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED, loader + " lacks " #name "; reinstall the Vulkan loader");
    RT_VULKAN_INSTANCE_FUNCTIONS(RT_VULKAN_LOAD)
#undef RT_VULKAN_LOAD
    if (validate && !add_messenger()) {
        functions_.vkDestroyInstance(instance_, nullptr);
        throw Failure(ARHOST_STATUS_ERROR_INTERNAL, "Vulkan's validation layers can't be asked for their messages");
    }
}

Instance::~Instance() {
    if (messenger_)
        reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(get_(instance_, "vkDestroyDebugUtilsMessengerEXT"))(
            instance_, messenger_, nullptr);
    functions_.vkDestroyInstance(instance_, nullptr);
}

void Instance::create(bool validate) {
    if (validate) {
        const auto enumerate = reinterpret_cast<PFN_vkEnumerateInstanceLayerProperties>(
            get_(nullptr, "vkEnumerateInstanceLayerProperties"));
        std::uint32_t count = 0;
        enumerate(&count, nullptr);
        std::vector<VkLayerProperties> layers(count);
        enumerate(&count, layers.data());
        if (std::none_of(layers.begin(), layers.end(), [](const VkLayerProperties &layer) {
                return !std::strcmp(layer.layerName, validation_layer);
            }))
            throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                          "option 'validate': Vulkan's validation layers are not installed (Debian: "
                          "vulkan-validationlayers); install them or leave the option out");
    }
    // Of the loader itself, whose 1.0 knows no 1.1 to ask for.
    const auto version =
        reinterpret_cast<PFN_vkEnumerateInstanceVersion>(get_(nullptr, "vkEnumerateInstanceVersion"));
    if (!version)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "the Vulkan loader is of version 1.0; 1.1 is needed: install a newer");
    VkApplicationInfo application{};
    application.sType = VK_STRUCTURE_TYPE_APPLICATION_INFO;
    application.pApplicationName = "arhost";
    application.apiVersion = VK_API_VERSION_1_2; // the most that is made use of
    VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(host_);
    const VkValidationFeatureEnableEXT feature = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
    VkValidationFeaturesEXT features{};
    features.sType = VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT;
    features.pNext = &messenger; // for what is said while the instance is made
    features.enabledValidationFeatureCount = 1;
    features.pEnabledValidationFeatures = &feature;
    const char *const extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
    VkInstanceCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO;
    info.pApplicationInfo = &application;
    if (validate) {
        info.pNext = &features;
        info.enabledLayerCount = 1;
        info.ppEnabledLayerNames = &validation_layer;
        info.enabledExtensionCount = 2;
        info.ppEnabledExtensionNames = extensions;
    }
    const auto create_instance = reinterpret_cast<PFN_vkCreateInstance>(get_(nullptr, "vkCreateInstance"));
    const VkResult result = create_instance(&info, nullptr, &instance_);
    if (result == VK_ERROR_INCOMPATIBLE_DRIVER || result == VK_ERROR_INITIALIZATION_FAILED)
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string("no Vulkan driver: ") + get_driver + told_by_environment());
    if (result == VK_ERROR_LAYER_NOT_PRESENT || (validate && result == VK_ERROR_EXTENSION_NOT_PRESENT))
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      "option 'validate': Vulkan's validation layers can't be loaded; install "
                      "them again (Debian: vulkan-validationlayers) or leave the option out");
    if (result == VK_ERROR_OUT_OF_HOST_MEMORY) // loaders say so of garbage, too
        throw Failure(
            ARHOST_STATUS_ERROR_UNSUPPORTED,
            "Vulkan can't be started (VK_ERROR_OUT_OF_HOST_MEMORY): no memory is left, or a file that names a "
            "driver or layer is damaged; look through vulkan/ in /usr/share and /etc and what VK_LAYER_PATH "
            "names, or use rt_embree" +
                told_by_environment());
    check(result, "making a Vulkan instance");
}

bool Instance::add_messenger() {
    const VkDebugUtilsMessengerCreateInfoEXT info = messenger_info(host_);
    const auto create =
        reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(get_(instance_, "vkCreateDebugUtilsMessengerEXT"));
    return create && create(instance_, &info, nullptr, &messenger_) == VK_SUCCESS;
}

std::vector<PhysicalDevice> Instance::devices() const {
    std::uint32_t count = 0;
    VkResult result = functions_.vkEnumeratePhysicalDevices(instance_, &count, nullptr);
    std::vector<VkPhysicalDevice> handles(count);
    if (result == VK_SUCCESS && count > 0)
        result = functions_.vkEnumeratePhysicalDevices(instance_, &count, handles.data());
    if (result == VK_ERROR_INITIALIZATION_FAILED || (result == VK_SUCCESS && count == 0))
        throw Failure(ARHOST_STATUS_ERROR_UNSUPPORTED,
                      std::string("no Vulkan device: ") + get_driver + told_by_environment());
    check(result, "listing the Vulkan devices");
    handles.resize(count);
    std::vector<PhysicalDevice> devices;
    for (const VkPhysicalDevice handle : handles) {
        VkPhysicalDeviceExternalMemoryHostPropertiesEXT import{};
        import.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_EXTERNAL_MEMORY_HOST_PROPERTIES_EXT;
        VkPhysicalDeviceIDProperties id{};
        id.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES;
        VkPhysicalDeviceProperties2 properties{};
        properties.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2;
        properties.pNext = &id;

        std::uint32_t extension_count = 0;
        functions_.vkEnumerateDeviceExtensionProperties(handle, nullptr, &extension_count, nullptr);
        std::vector<VkExtensionProperties> extensions(extension_count);
        functions_.vkEnumerateDeviceExtensionProperties(handle, nullptr, &extension_count, extensions.data());
        const auto has = [&](const char *name) {
            return std::any_of(extensions.begin(), extensions.end(), [&](const VkExtensionProperties &extension) {
                return !std::strcmp(extension.extensionName, name);
            });
        };
        PhysicalDevice device{};
        device.imports_host_memory =
            has(VK_EXT_EXTERNAL_MEMORY_HOST_EXTENSION_NAME) && imports_host_memory(functions_, handle);
        if (device.imports_host_memory)
            id.pNext = &import;
        functions_.vkGetPhysicalDeviceProperties2(handle, &properties);
        device.handle = handle;
        device.name = properties.properties.deviceName;
        device.uuid = hexadecimal(id.deviceUUID);
        device.properties = properties.properties;
        device.import_alignment = import.minImportedHostPointerAlignment;
        const bool has_trees = properties.properties.apiVersion >= VK_API_VERSION_1_2 &&
                               has(VK_KHR_ACCELERATION_STRUCTURE_EXTENSION_NAME) &&
                               has(VK_KHR_DEFERRED_HOST_OPERATIONS_EXTENSION_NAME);
        add_tracing(functions_, device, has_trees && has(VK_KHR_RAY_QUERY_EXTENSION_NAME),
                    has_trees && has(VK_KHR_RAY_TRACING_PIPELINE_EXTENSION_NAME));

        std::uint32_t family_count = 0;
        functions_.vkGetPhysicalDeviceQueueFamilyProperties(handle, &family_count, nullptr);
        std::vector<VkQueueFamilyProperties> families(family_count);
        functions_.vkGetPhysicalDeviceQueueFamilyProperties(handle, &family_count, families.data());
        // Better one that draws no windows, which a long image would hold up.
        const auto that_computes = [&](VkQueueFlags but) {
            return std::find_if(families.begin(), families.end(), [but](const VkQueueFamilyProperties &family) {
                return family.queueFlags & VK_QUEUE_COMPUTE_BIT && !(family.queueFlags & but);
            });
        };
        auto computes = that_computes(VK_QUEUE_GRAPHICS_BIT);
        if (computes == families.end())
            computes = that_computes(0);
        device.queue_family = VK_QUEUE_FAMILY_IGNORED;
        if (computes != families.end()) {
            device.queue_family = static_cast<std::uint32_t>(computes - families.begin());
            device.timestamp_bits = computes->timestampValidBits;
        }
        devices.push_back(device);
    }
    return devices;
}

const PhysicalDevice &choose_device(const std::vector<PhysicalDevice> &devices, const std::string &wanted) {
    if (wanted == "auto")
        return *std::max_element(devices.begin(), devices.end(),
                                 [](const PhysicalDevice &a, const PhysicalDevice &b) { return rank(a) < rank(b); });
    const auto refuse = [&](const std::string &why) {
        throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION, "option 'device': " + why + " '" + wanted +
                                                             "'; there are: " + list_of(devices) +
                                                             "; give a number, a UUID, a part of a name, or auto");
    };
    std::string uuid = lower(wanted);
    std::erase(uuid, '-');
    std::vector<const PhysicalDevice *> whole, part; // whose number, UUID or name it is; whose name holds it
    for (std::size_t i = 0; i < devices.size(); ++i) {
        const std::string name = lower(devices[i].name);
        if (wanted == std::to_string(i) || devices[i].uuid == uuid || name == lower(wanted))
            whole.push_back(&devices[i]);
        else if (!wanted.empty() && name.find(lower(wanted)) != std::string::npos)
            part.push_back(&devices[i]);
    }
    const auto &meant = whole.empty() ? part : whole;
    if (meant.size() > 1)
        refuse("more than one device is called");
    if (meant.empty())
        refuse("no device is");
    return *meant[0];
}

std::vector<Path> choose_paths(const PhysicalDevice &device, const std::string &wanted) {
    // On a processor the device's trees are as much code as ours, and slower (README.md).
    if (wanted == "auto" && device.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU)
        return {Path::plain};
    if (wanted == "auto")
        return {device.paths.rbegin(), device.paths.rend()};
    for (const Path path : device.paths)
        if (wanted == name_of(path))
            return {path};
    throw Failure(ARHOST_STATUS_ERROR_CONFIGURATION,
                  "option 'path': the Vulkan device '" + device.name + "' has no '" + wanted + "'; it has " +
                      list_of(device.paths) + ": give one of these, auto, or another device");
}

} // namespace rt_vulkan
