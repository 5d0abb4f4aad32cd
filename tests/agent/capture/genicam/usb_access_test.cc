// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/usb_access.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "tests/testing/temporary_directory.h"

namespace rigcal::agent::usb_access_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// Stands in for sysfs: device 2-1 is a camera with an interface for control and one for its stream,
// 2-2 a camera too, 3-1 a keyboard.
class UsbAccess : public ::testing::Test {
 protected:
  UsbAccess() {
    AddDevice("2-1", "2", "3");
    AddInterface("2-1:1.0", "ef", "05");
    AddInterface("2-1:1.1", "ef", "05");
    AddDevice("2-2", "2", "17");
    AddInterface("2-2:1.0", "ef", "05");
    AddDevice("3-1", "3", "4");
    AddInterface("3-1:1.0", "03", "01");
  }
  void AddDevice(const std::string& name, const std::string& bus, const std::string& device) {
    Write(name, "busnum", bus);
    Write(name, "devnum", device);
  }
  void AddInterface(const std::string& name, const std::string& kind, const std::string& subclass) {
    Write(name, "bInterfaceClass", kind);
    Write(name, "bInterfaceSubClass", subclass);
  }
  void Write(const std::string& folder, const char* name, const std::string& text) {
    std::filesystem::create_directories(directory_.path() / folder);
    std::ofstream(directory_.path() / folder / name) << text << "\n";
  }
  std::string Unusable(const std::string& closed) {
    return UnusableUsbCameras(directory_.path(), "/dev/bus/usb",
                              [&](const auto& file) { return file.string().ends_with(closed); });
  }

  const testing::TemporaryDirectory directory_;
};

TEST_F(UsbAccess, NamesTheCameraAndWhatGivesTheRight) {
  const std::string text = Unusable("002/003");
  EXPECT_THAT(text, AllOf(HasSubstr("may not use /dev/bus/usb/002/003:"),
                          HasSubstr("60-rigcal-agent.rules"), HasSubstr("usermod -aG rigcal")));
  EXPECT_THAT(text, Not(HasSubstr("017")));
}

TEST_F(UsbAccess, SaysNothingWhereEveryCameraIsOpenOrThereIsNone) {
  EXPECT_EQ(Unusable("none"), "");
  // The keyboard's.
  EXPECT_EQ(Unusable("003/004"), "");
  EXPECT_EQ(UnusableUsbCameras(directory_.path() / "nothing", "/dev/bus/usb"), "");
}

TEST_F(UsbAccess, PassesOverNumbersThatCannotBeRead) {
  Write("2-1", "devnum", "x");
  EXPECT_EQ(Unusable("002/003"), "");
}

}  // namespace
}  // namespace rigcal::agent::usb_access_test
