// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/usb_access.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <fstream>
#include <set>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {
namespace {

// The word in an attribute of sysfs; empty: there is none.
std::string Attribute(const std::filesystem::path& folder, const char* name) {
  std::ifstream file(folder / name);
  std::string word;
  file >> word;
  return word;
}

bool IsVisionInterface(const std::filesystem::path& folder) {
  return Attribute(folder, "bInterfaceClass") == "ef" &&
         Attribute(folder, "bInterfaceSubClass") == "05";
}

// "/dev/bus/usb/002/003" of the device with this folder; empty: its numbers cannot be read.
std::filesystem::path DeviceFile(const std::filesystem::path& folder,
                                 const std::filesystem::path& devices) {
  int bus = 0;
  int device = 0;
  if (!absl::SimpleAtoi(Attribute(folder, "busnum"), &bus) ||
      !absl::SimpleAtoi(Attribute(folder, "devnum"), &device)) {
    return {};
  }
  char name[32];
  std::snprintf(name, sizeof(name), "%03d/%03d", bus, device);
  return devices / name;
}

}  // namespace

bool IsClosedToThisUser(const std::filesystem::path& file) {
  return access(file.c_str(), R_OK | W_OK) != 0 && errno == EACCES;
}

std::string UnusableUsbCameras(const std::filesystem::path& sysfs,
                               const std::filesystem::path& devices,
                               const std::function<bool(const std::filesystem::path&)>& is_closed) {
  std::set<std::string> closed;
  std::error_code error;
  for (std::filesystem::directory_iterator each(sysfs, error), end; !error && each != end;
       each.increment(error)) {
    // "2-1:1.0" is an interface of the device "2-1".
    const std::string name = each->path().filename().string();
    const size_t colon = name.find(':');
    if (colon == std::string::npos || !IsVisionInterface(each->path())) continue;
    const std::filesystem::path file = DeviceFile(sysfs / name.substr(0, colon), devices);
    if (!file.empty() && is_closed(file)) closed.insert(file.string());
  }
  if (closed.empty()) return "";
  return absl::StrCat(
      "; this user may not use ", absl::StrJoin(closed, ", "),
      ": install the udev rule 60-rigcal-agent.rules (package rigcal-agent, or deploy/udev), add "
      "the user to its group (sudo usermod -aG rigcal USER), log in anew and plug the camera in "
      "again");
}

}  // namespace rigcal::agent
