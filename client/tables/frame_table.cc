// SPDX-License-Identifier: Apache-2.0
#include "client/tables/frame_table.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

using Group = v1::InformationGroup;
using Parameter = v1::ParameterInformation;

constexpr double kMmOfM = 1000;
constexpr int kMaxShownResiduals = 30;
// A group without which one sigma would be twice as large.
constexpr float kWeakShare = 0.75F;

std::string Three(const v1::Vector3& values, double scale, int digits) {
  return absl::StrCat(FormatFixed(scale * values.x(), digits), ", ",
                      FormatFixed(scale * values.y(), digits), ", ",
                      FormatFixed(scale * values.z(), digits));
}

std::string FrameHead(const v1::Calibration& calibration) {
  const v1::CalibrationFrame& frame = calibration.frame();
  const std::string& before = frame.calibration_id();
  switch (frame.source()) {
    case v1::FRAME_SOURCE_FLOOR:
      return absl::StrCat("z = 0 is the floor, z up; from ", before);
    case v1::FRAME_SOURCE_POINTS:
      return absl::StrCat("that of ", FormatCount(frame.residual_count(), "point"),
                          " of known coordinates; from ", before);
    case v1::FRAME_SOURCE_PATH:
      return absl::StrCat("z = 0 is the plane of a path; from ", before);
    case v1::FRAME_SOURCE_DOWN:
      return absl::StrCat("z is up; from ", before);
    case v1::FRAME_SOURCE_TRANSFORM:
      return absl::StrCat("a given transform of that of ", before);
    case v1::FRAME_SOURCE_KEPT:
      return absl::StrCat("that of ", before, ", kept over ", absl::StrJoin(frame.cameras(), ", "));
    case v1::FRAME_SOURCE_NOT_KEPT:
      return absl::StrCat("that of camera ", calibration.reference_camera(), ", NOT that of ",
                          before, ": ", frame.problem());
    default:
      return absl::StrCat("that of camera ", calibration.reference_camera());
  }
}

std::string PercentText(float share) { return absl::StrCat(FormatFixed(100 * share, 0), " %"); }

std::string NameOf(const Group& group) {
  switch (group.kind()) {
    case Group::KIND_SESSION:
      return group.session_id();
    case Group::KIND_SPAN:
      return absl::StrCat(group.session_id(), " ", FormatFixed(group.from_s(), 1), " to ",
                          FormatFixed(group.to_s(), 1), " s");
    default:
      return group.camera();
  }
}

std::string InSentence(const Group& group) {
  switch (group.kind()) {
    case Group::KIND_SESSION:
      return absl::StrCat("session ", group.session_id());
    case Group::KIND_SPAN:
      return absl::StrCat(FormatFixed(group.to_s() - group.from_s(), 1), " s of session ",
                          group.session_id(), " (", FormatFixed(group.from_s(), 1), " to ",
                          FormatFixed(group.to_s(), 1), " s)");
    default:
      return absl::StrCat(group.camera(), " alone");
  }
}

std::string ParameterName(const Parameter& parameter) {
  switch (parameter.kind()) {
    case Parameter::KIND_POSITION:
      return absl::StrCat("position along ", parameter.name());
    case Parameter::KIND_ROTATION:
      return absl::StrCat("direction about ", parameter.name());
    case Parameter::KIND_TIME_OFFSET:
      return "time offset";
    default:
      return parameter.name();
  }
}

std::string SigmaText(const Parameter& parameter) {
  switch (parameter.kind()) {
    case Parameter::KIND_POSITION:
      return absl::StrCat(FormatFixed(kMmOfM * parameter.sigma(), 3), " mm");
    case Parameter::KIND_ROTATION:
      return absl::StrCat(FormatFixed(DegreesFromRadians(parameter.sigma()), 4), " deg");
    case Parameter::KIND_TIME_OFFSET:
      return absl::StrCat(FormatFixed(1e3 * parameter.sigma(), 4), " ms");
    default:
      return FormatFixed(parameter.sigma(), 4);
  }
}

// Of one kind, the group with the largest share; -1: there is none.
int LargestGroup(const v1::CalibrationInformation& information, const Parameter& parameter,
                 Group::Kind kind) {
  int largest = -1;
  const int count = std::min(information.groups_size(), parameter.share_size());
  for (int g = 0; g < count; ++g) {
    if (information.groups(g).kind() != kind || parameter.share(g) < 0) continue;
    if (largest < 0 || parameter.share(g) > parameter.share(largest)) largest = g;
  }
  return largest;
}

std::string LargestText(const v1::CalibrationInformation& information, const Parameter& parameter,
                        Group::Kind kind) {
  const int largest = LargestGroup(information, parameter, kind);
  if (largest < 0) return "-";
  return absl::StrCat(NameOf(information.groups(largest)), ": ",
                      PercentText(parameter.share(largest)));
}

// One sentence for the parameters of a camera that rest on the same groups.
std::string WeakSpots(const v1::CalibrationInformation& information) {
  std::vector<std::string> order;
  std::map<std::string, std::vector<std::string>> parameters;  // by camera and what it rests on
  std::map<std::string, std::pair<std::string, std::string>> parts;
  for (const Parameter& parameter : information.parameters()) {
    std::vector<std::string> on;
    for (const Group::Kind kind : {Group::KIND_SPAN, Group::KIND_SESSION, Group::KIND_CAMERA}) {
      const int largest = LargestGroup(information, parameter, kind);
      if (largest < 0 || parameter.share(largest) < kWeakShare) continue;
      // A span says which session.
      if (kind == Group::KIND_SESSION && !on.empty()) continue;
      on.push_back(InSentence(information.groups(largest)));
    }
    if (on.empty()) continue;
    const std::string rests = absl::StrJoin(on, " and on ");
    const std::string key = absl::StrCat(parameter.camera(), "\n", rests);
    if (!parameters.contains(key)) order.push_back(key);
    parameters[key].push_back(ParameterName(parameter));
    parts[key] = {parameter.camera(), rests};
  }
  if (order.empty()) {
    return "no weak spot: no session, tenth of a session or camera holds three quarters of what is "
           "known of a parameter\n";
  }
  std::string text = "weak spots (without it one sigma would be twice as large, or more):\n";
  for (const std::string& key : order) {
    const std::vector<std::string>& names = parameters[key];
    absl::StrAppend(&text, "  ", parts[key].first, "'s ", absl::StrJoin(names, ", "),
                    names.size() == 1 ? " rests on " : " rest on ", parts[key].second, "\n");
  }
  return text;
}

}  // namespace

std::string FormatFrame(const v1::Calibration& calibration) {
  const v1::CalibrationFrame& frame = calibration.frame();
  std::string text = absl::StrCat("frame         ", FrameHead(calibration), "\n");
  if (!calibration.has_frame() || frame.source() == v1::FRAME_SOURCE_NOT_KEPT) {
    return Printable(text);
  }
  const v1::Quaternion& q = frame.new_from_rig().rotation();
  absl::StrAppend(&text, "new_from_rig  ", Three(frame.new_from_rig().translation_m(), 1, 6),
                  " m; ", FormatFixed(q.w(), 8), ", ", FormatFixed(q.x(), 8), ", ",
                  FormatFixed(q.y(), 8), ", ", FormatFixed(q.z(), 8), " (w x y z)\n",
                  "one sigma     axes ",
                  Three(frame.rotation_sigma_rad(), DegreesFromRadians(1), 4),
                  " degrees about x, y, z; origin ", Three(frame.position_sigma_m(), kMmOfM, 3),
                  " mm\n", "lowest camera ", frame.lowest_camera(),
                  ", z = ", FormatFixed(frame.lowest_camera_m(), 3), " m\n");
  if (frame.residuals().empty()) return Printable(text);
  absl::StrAppend(&text, "residuals     ", FormatFixed(kMmOfM * frame.residual_rms_m(), 3),
                  " mm rms\n");
  TextTable table;
  table.Words({"point"}).Numbers({"residual", "sigma"}, "mm");
  for (const v1::PointResidual& residual : frame.residuals()) {
    if (static_cast<int>(&residual - &frame.residuals(0)) == kMaxShownResiduals) break;
    table.AddRow({residual.name(), FormatFixed(kMmOfM * residual.residual_m(), 3),
                  FormatFixed(kMmOfM * residual.sigma_m(), 3)});
  }
  absl::StrAppend(&text, table.Format(2));
  const int more = static_cast<int>(frame.residual_count()) -
                   std::min(kMaxShownResiduals, frame.residuals_size());
  if (more > 0) absl::StrAppend(&text, "  and ", more, " more\n");
  return Printable(text);
}

std::string FormatScaleSources(const v1::Calibration& calibration) {
  if (!calibration.has_scale()) return "";
  const v1::CalibrationScale& scale = calibration.scale();
  TextTable table;
  table.Words({"source"})
      .Numbers({"change", "one sigma"}, "of every length by itself (%)")
      .Numbers({"difference (%)", "sigmas"}, "from the others together");
  for (const v1::ScaleSourceReport& source : scale.sources()) {
    table.AddRow({source.name(), FormatFixed(100 * source.own_change(), 3),
                  FormatFixed(100 * source.own_sigma(), 3),
                  FormatFixed(100 * source.from_others(), 3),
                  FormatFixed(source.from_others_sigmas(), 1)});
  }
  return Printable(absl::StrCat(table.Format(), "scale         every length of ",
                                scale.calibration_id(), " times ", FormatFixed(scale.factor(), 6),
                                ", one sigma ", FormatFixed(100 * scale.sigma_rel(), 4), " %\n"));
}

std::string FormatInformation(const std::string& id,
                              const v1::CalibrationInformation& information) {
  std::string text = absl::StrCat("What holds calibration ", id,
                                  ": the part of a parameter's information that would be lost "
                                  "without a group\n");
  if (!information.calibration_id().empty()) {
    absl::StrAppend(&text, "(of the solve of ", information.calibration_id(),
                    ", along the axes of its frame)\n");
  }
  TextTable table;
  table.Words({"camera", "parameter"})
      .Numbers({"one sigma"})
      .Words({"session", "span of time", "other camera"});
  for (const Parameter& parameter : information.parameters()) {
    table.AddRow({parameter.camera(), ParameterName(parameter), SigmaText(parameter),
                  LargestText(information, parameter, Group::KIND_SESSION),
                  LargestText(information, parameter, Group::KIND_SPAN),
                  LargestText(information, parameter, Group::KIND_CAMERA)});
  }
  absl::StrAppend(&text, table.Format(2), WeakSpots(information));
  return Printable(text);
}

}  // namespace rigcal::client
