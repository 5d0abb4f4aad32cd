// SPDX-License-Identifier: Apache-2.0
#include "common/export/camera_file_names.h"

#include <algorithm>
#include <set>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace rigcal {
namespace {

// Microsoft, "Naming Files, Paths, and Namespaces": whatever follows the first dot.
bool IsDeviceOfWindows(std::string_view name) {
  const std::string base = absl::AsciiStrToUpper(std::string(name.substr(0, name.find('.'))));
  if (base == "CON" || base == "PRN" || base == "AUX" || base == "NUL") return true;
  return base.size() == 4 && (base.starts_with("COM") || base.starts_with("LPT")) &&
         absl::ascii_isdigit(static_cast<unsigned char>(base[3]));
}

}  // namespace

std::vector<std::string> CameraFileNames(const ExportedRig& rig) {
  std::vector<std::string> names;
  std::set<std::string> taken;
  for (const ExportedCamera& camera : rig.cameras) {
    const std::string prefix =
        camera.name.starts_with('-') || IsDeviceOfWindows(camera.name) ? "camera_" : "";
    const std::string wished = prefix + camera.name;
    std::string name = wished;
    for (int i = 2; !taken.insert(absl::AsciiStrToLower(name)).second; ++i) {
      name = absl::StrCat(wished, "_", i);
    }
    names.push_back(std::move(name));
  }
  return names;
}

}  // namespace rigcal
