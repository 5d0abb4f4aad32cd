// SPDX-License-Identifier: Apache-2.0
// Static transforms in launch files of ROS: nodes of tf2_ros's static_transform_publisher. Both
// programs name the pose of the child's frame in the parent's; ROS 1 takes it as
// "x y z qx qy qz qw parent child", ROS 2 as options.
#include <Eigen/Geometry>
#include <cmath>
#include <map>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/import/import_readers.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

struct RosTransform {
  std::string parent, child;
  RigidTransform child_from_parent;
};

absl::StatusOr<RosTransform> RosTransformOf(const XmlElement& node) {
  RIGCAL_ASSIGN_OR_RETURN(const std::string args, node.Text("args"));
  const std::vector<std::string> words =
      absl::StrSplit(args, absl::ByAnyChar(" \t\r\n"), absl::SkipEmpty());
  const char* const names[] = {"--x", "--y", "--z", "--qx", "--qy", "--qz", "--qw"};
  std::string texts[7] = {"0", "0", "0", "0", "0", "0", "1"};
  RosTransform transform;
  if (!words.empty() && absl::StartsWith(words.front(), "--")) {
    std::map<std::string, std::string> options;
    std::string name;
    for (const std::string& word : words) {
      if (absl::StartsWith(word, "--")) {
        name = word;
      } else {
        std::string& value = options[name];
        absl::StrAppend(&value, value.empty() ? "" : " ", word);
      }
    }
    for (const char* const angle : {"--roll", "--pitch", "--yaw"}) {
      if (options.contains(angle)) {
        return node.Error(absl::StrCat("has ", angle, "; only quaternions can be read"));
      }
    }
    for (size_t i = 0; i < 7; ++i) {
      if (options.contains(names[i])) texts[i] = options[names[i]];
    }
    transform.parent = options["--frame-id"];
    transform.child = options["--child-frame-id"];
  } else {
    // "$(arg rig_frame)" is two words.
    if (words.size() < 9) {
      return node.Error("has args that are not x y z qx qy qz qw parent child");
    }
    std::copy_n(words.begin(), 7, texts);
    for (size_t i = 7; i + 1 < words.size(); ++i) transform.parent += words[i];
    transform.child = words.back();
  }
  double v[7];
  for (size_t i = 0; i < 7; ++i) {
    if (!absl::SimpleAtod(texts[i], &v[i]) || !std::isfinite(v[i])) {
      return node.Error(absl::StrCat(names[i], " is not a finite number"));
    }
  }
  const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
  if (std::abs(rotation.norm() - 1) > 1e-3) return node.Error("has a quaternion of another length");
  transform.child_from_parent =
      RigidTransform(rotation.normalized(), Eigen::Vector3d(v[0], v[1], v[2])).Inverse();
  return transform;
}

}  // namespace

absl::Status AddRosTransforms(const std::string& path, const std::string& text, ImportedRig* rig) {
  RIGCAL_ASSIGN_OR_RETURN(const XmlDocument document, XmlDocument::Parse(path, text));
  std::string rig_frame;
  for (const XmlElement& node : document.root().Children("node")) {
    const char* const program = node.Has("exec") ? "exec" : "type";
    const absl::StatusOr<std::string> name = node.Text(program);
    if (!name.ok() || *name != "static_transform_publisher") continue;
    RIGCAL_ASSIGN_OR_RETURN(const RosTransform transform, RosTransformOf(node));
    for (ImportedCamera& camera : rig->cameras) {
      // The names that a camera has in its file come first: files are called otherwise where a name
      // cannot be a file's.
      const std::string named =
          camera.other_name.empty() ? camera.name : CameraNameFrom(camera.other_name);
      if (camera.cam_from_rig ||
          (transform.child != named + "_optical_frame" && transform.child != named)) {
        continue;
      }
      if (!rig_frame.empty() && rig_frame != transform.parent) {
        return node.Error(absl::StrCat("puts camera ", named, " into the frame ", transform.parent,
                                       ", others are in ", rig_frame));
      }
      rig_frame = transform.parent;
      camera.name = named;
      camera.cam_from_rig = transform.child_from_parent;
    }
  }
  return absl::OkStatus();
}

}  // namespace rigcal
