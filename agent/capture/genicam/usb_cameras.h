// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace rigcal::agent {

// A USB3 Vision camera as the kernel sees it: also one that this user may not open, which Aravis
// leaves out without a word.
struct UsbCamera {
  std::string vendor{};
  std::string model{};
  std::string serial{};
  std::filesystem::path node{};  // its file below /dev/bus/usb
  bool may_open = false;         // this user may read and write it
};

// By node. `devices` is /sys/bus/usb/devices, `nodes` /dev/bus/usb. A folder that is not there has
// no camera. A camera is known by an interface of class 0xEF, subclass 0x05, protocol 0 (control).
// Source: USB3 Vision 1.0, 4.1 (device class codes).
std::vector<UsbCamera> FindUsbCameras(const std::filesystem::path& devices = "/sys/bus/usb/devices",
                                      const std::filesystem::path& nodes = "/dev/bus/usb");

// Why a camera may seem not to be there: "; this user may not use ...: do ...", naming each that
// this user may not open, and what gives him the right. Empty: there is none.
std::string UnusableUsbCameras(const std::vector<UsbCamera>& cameras = FindUsbCameras());

}  // namespace rigcal::agent
