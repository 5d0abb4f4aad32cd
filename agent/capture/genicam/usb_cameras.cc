// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/genicam/usb_cameras.h"

#include <unistd.h>

#include <fstream>
#include <map>
#include <system_error>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

namespace rigcal::agent {
namespace {

// The first line; empty: there is none.
std::string LineOf(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return line;
}

bool IsVisionControl(const std::filesystem::path& interface) {
  return LineOf(interface / "bInterfaceClass") == "ef" &&
         LineOf(interface / "bInterfaceSubClass") == "05" &&
         LineOf(interface / "bInterfaceProtocol") == "00";
}

}  // namespace

std::vector<UsbCamera> FindUsbCameras(const std::filesystem::path& devices,
                                      const std::filesystem::path& nodes) {
  std::map<std::filesystem::path, UsbCamera> found;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(devices, error), end; entry != end && !error;
       entry.increment(error)) {
    // "2-1:1.0" is the first interface of device "2-1".
    const std::string name = entry->path().filename().string();
    const size_t colon = name.find(':');
    if (colon == name.npos || !IsVisionControl(entry->path())) continue;
    const std::filesystem::path device = devices / name.substr(0, colon);
    int bus = 0;
    int number = 0;
    if (!absl::SimpleAtoi(LineOf(device / "busnum"), &bus) ||
        !absl::SimpleAtoi(LineOf(device / "devnum"), &number)) {
      continue;
    }
    const std::filesystem::path node =
        nodes / absl::StrFormat("%03d", bus) / absl::StrFormat("%03d", number);
    found[node] = {.vendor = LineOf(device / "manufacturer"),
                   .model = LineOf(device / "product"),
                   .serial = LineOf(device / "serial"),
                   .node = node,
                   .may_open = access(node.c_str(), R_OK | W_OK) == 0};
  }
  std::vector<UsbCamera> cameras;
  for (auto& [node, camera] : found) cameras.push_back(std::move(camera));
  return cameras;
}

std::string UnusableUsbCameras(const std::vector<UsbCamera>& cameras) {
  std::vector<std::string> closed;
  for (const UsbCamera& camera : cameras) {
    if (!camera.may_open) closed.push_back(camera.node.string());
  }
  if (closed.empty()) return "";
  return absl::StrCat(
      "; this user may not use ", absl::StrJoin(closed, ", "),
      ": install the udev rule 60-rigcal-agent.rules (package rigcal-agent, or deploy/udev), add "
      "the user to its group (sudo usermod -aG rigcal USER), log in anew and plug the camera in "
      "again");
}

}  // namespace rigcal::agent
