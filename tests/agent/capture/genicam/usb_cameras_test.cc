// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/usb_cameras.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::usb_cameras_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// A device of the kernel's list with one interface.
void AddDevice(const testing::TemporaryDirectory& folder, const std::string& name,
               const std::string& interface_class, const std::string& number) {
  const std::string device = "devices/" + name;
  std::filesystem::create_directories(folder.path() / device);
  std::filesystem::create_directories(folder.path() / (device + ":1.0"));
  folder.WriteFile(device + "/manufacturer", "FLIR\n");
  folder.WriteFile(device + "/product", "Blackfly S\n");
  folder.WriteFile(device + "/serial", "2345" + number + "\n");
  folder.WriteFile(device + "/busnum", "2\n");
  folder.WriteFile(device + "/devnum", number + "\n");
  folder.WriteFile(device + ":1.0/bInterfaceClass", interface_class + "\n");
  folder.WriteFile(device + ":1.0/bInterfaceSubClass", "05\n");
  folder.WriteFile(device + ":1.0/bInterfaceProtocol", "00\n");
}

TEST(UsbCameras, AreTheDevicesWithAVisionInterface) {
  const testing::TemporaryDirectory folder;
  AddDevice(folder, "2-1", "ef", "7");
  AddDevice(folder, "2-2", "03", "8");  // a mouse
  std::filesystem::create_directories(folder.path() / "nodes/002");
  folder.WriteFile("nodes/002/007", "");
  const auto cameras = FindUsbCameras(folder.path() / "devices", folder.path() / "nodes");
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_EQ(cameras[0].vendor, "FLIR");
  EXPECT_EQ(cameras[0].model, "Blackfly S");
  EXPECT_EQ(cameras[0].serial, "23457");
  EXPECT_EQ(cameras[0].node, folder.path() / "nodes/002/007");
  EXPECT_TRUE(cameras[0].may_open);
}

TEST(UsbCameras, ThatCannotBeOpenedAreListed) {
  const testing::TemporaryDirectory folder;
  AddDevice(folder, "2-1", "ef", "7");  // without a file below /dev
  const auto cameras = FindUsbCameras(folder.path() / "devices", folder.path() / "nodes");
  ASSERT_EQ(cameras.size(), 1u);
  EXPECT_FALSE(cameras[0].may_open);
}

TEST(UsbCameras, ThatCannotBeOpenedAreNamedWithWhatGivesTheRight) {
  EXPECT_EQ(UnusableUsbCameras({}), "");
  EXPECT_EQ(UnusableUsbCameras({{.node = "/dev/bus/usb/002/003", .may_open = true}}), "");
  const std::string text = UnusableUsbCameras(
      {{.node = "/dev/bus/usb/002/003"}, {.node = "/dev/bus/usb/002/017", .may_open = true}});
  EXPECT_THAT(text, AllOf(HasSubstr("may not use /dev/bus/usb/002/003:"),
                          HasSubstr("60-rigcal-agent.rules"), HasSubstr("usermod -aG rigcal"),
                          Not(HasSubstr("017"))));
}

TEST(UsbCameras, AreNoneWhereTheListIsMissingOrDamaged) {
  const testing::TemporaryDirectory folder;
  EXPECT_TRUE(FindUsbCameras(folder.path() / "none", folder.path() / "nodes").empty());
  AddDevice(folder, "2-1", "ef", "seven");
  EXPECT_TRUE(FindUsbCameras(folder.path() / "devices", folder.path() / "nodes").empty());
}

}  // namespace
}  // namespace rigcal::agent::usb_cameras_test
