// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>

namespace rigcal::agent {

// The file is there, and this user has no right to read and write it.
bool IsClosedToThisUser(const std::filesystem::path& file);

// Why a camera at USB may seem not to be there: "; this user may not use ...: do ...", naming each
// USB3 Vision camera (interface class 0xEF, subclass 0x05) whose device file this user may not
// write, and what gives him the right. Empty: there is none. The arguments are for tests.
std::string UnusableUsbCameras(
    const std::filesystem::path& sysfs = "/sys/bus/usb/devices",
    const std::filesystem::path& devices = "/dev/bus/usb",
    const std::function<bool(const std::filesystem::path&)>& is_closed = IsClosedToThisUser);

}  // namespace rigcal::agent
