// SPDX-License-Identifier: Apache-2.0
#include "base/usb_device.hpp"
#include "plugin_under_test.hpp"

#include <gmock/gmock.h>

#include <fstream>

using namespace arhost::base;
using testing::ElementsAre;
namespace fs = std::filesystem;

namespace {

// A folder like /sys/bus/usb/devices.
struct UsbDevices : testing::Test {
    void add(const std::string &port, const std::string &vendor, const std::string &product,
             const std::string &serial, int bus, int number) const {
        set(port, "idVendor", vendor);
        set(port, "idProduct", product);
        set(port, "busnum", std::to_string(bus));
        set(port, "devnum", std::to_string(number));
        if (!serial.empty())
            set(port, "serial", serial);
    }
    void set(const std::string &port, const std::string &attribute, const std::string &value) const {
        fs::create_directories(folder.path() / port);
        std::ofstream(folder.path() / port / attribute) << value << "\n";
    }
    std::string node_of(const UsbIdentity &identity) const {
        const auto found = find_usb_device(identity, folder.path());
        return found ? found->node.string() : "none";
    }
    arhost::test::ScratchFolder folder;
};

} // namespace

TEST_F(UsbDevices, AreFoundByIdsAndSerialNumber) {
    add("1-2", "046d", "0825", "A:1", 1, 4);
    add("1-1", "046d", "0825", "B", 1, 23);
    add("2-1", "046d", "0826", "", 2, 104);
    EXPECT_EQ(node_of("046d:0825:A:1"), "/dev/bus/usb/001/004");
    EXPECT_EQ(node_of("046d:0825:B"), "/dev/bus/usb/001/023");
    EXPECT_EQ(node_of("046d:0825"), "/dev/bus/usb/001/023") << "the first by its port";
    EXPECT_EQ(node_of("046d:0826"), "/dev/bus/usb/002/104");
    EXPECT_EQ(node_of("046d:0825:A"), "none");
    EXPECT_EQ(node_of("046d:0827"), "none");
    EXPECT_EQ(node_of(""), "none");
    EXPECT_FALSE(find_usb_device("046d:0825", folder.path() / "missing"));
}

TEST_F(UsbDevices, HaveInterfacesWithAndWithoutDrivers) {
    add("1-2", "046d", "0825", "", 1, 4);
    add("1-2.1", "046d", "0001", "", 1, 5);
    for (const char *interface : {"1-2:1.0", "1-2:1.10", "1-2:1.2", "1-2.1:1.7"})
        fs::create_directories(folder.path() / interface);
    fs::create_directories(folder.path() / "1-2:1.2" / "driver");
    EXPECT_THAT(find_usb_device("046d:0825", folder.path())->driver_less, ElementsAre(0u, 10u));
    EXPECT_THAT(find_usb_device("046d:0001", folder.path())->driver_less, ElementsAre(7u));
}

TEST_F(UsbDevices, ThatAreJustDisappearingAreNotFound) {
    set("1-2", "idVendor", "046d");
    set("1-2", "idProduct", "0825");
    EXPECT_EQ(node_of("046d:0825"), "none");
    set("1-2", "busnum", "1");
    set("1-2", "devnum", "../7");
    EXPECT_EQ(node_of("046d:0825"), "none");
}
