// SPDX-License-Identifier: Apache-2.0
#include "server/solve/rig/target_parts.h"

#include <algorithm>

namespace rigcal::server {

namespace {

bool IsPoints(const Target& target) { return !target.HasLengths(); }

}  // namespace

template <typename Function>
void TargetParts::ForEach(const Function& function) {
  function(&first_);
  for (auto& [session, part] : others_) function(&part);
}

TargetParts::TargetParts(const Target& target, const std::map<std::string, Target>& others) {
  first_.target = target;
  bool points_only = IsPoints(target);
  for (const auto& [session, other] : others) {
    others_[session].target = other;
    points_only = points_only && IsPoints(other);
  }
  ForEach([&](Part* part) { Place(points_only, part); });
}

void TargetParts::Place(bool points_only, Part* part) {
  const bool is_point = IsPoints(part->target);
  if (is_point) part->target.marker_positions_m = {0};
  part->is_point = is_point && !points_only;
  part->is_rigid = part->is_point || part->target.kind == TargetKind::kRigid ||
                   (part->target.IsStatic() && !is_point);
  if (!part->is_rigid) return PlaceLine(part);
  std::vector<TargetPoint> points = part->target.points;
  if (part->is_point) points = {{"point", 0, 0, 0, 0}};
  for (size_t i = 0; i < first_points_.size(); ++i) {
    const auto first = points_.begin() + first_points_[i];
    const auto last =
        i + 1 < first_points_.size() ? points_.begin() + first_points_[i + 1] : points_.end();
    if (!std::equal(first, last, points.begin(), points.end())) continue;
    part->first_marker = first_points_[i];
    return;
  }
  part->first_marker = static_cast<int>(points_.size());
  first_points_.push_back(part->first_marker);
  points_.insert(points_.end(), points.begin(), points.end());
}

const TargetParts::Part& TargetParts::Of(const std::string& session_id) const {
  const auto found = others_.find(session_id);
  return found == others_.end() ? first_ : found->second;
}

void TargetParts::PlaceLine(Part* part) {
  const Target& target = part->target;
  int first = 0;
  for (const Target& line : lines_) {
    part->first_marker = first;
    // A single marker has no spans.
    const bool same_tolerance =
        target.marker_positions_m.size() == 1 || line.span_tolerance_m == target.span_tolerance_m;
    if (line.marker_positions_m == target.marker_positions_m && same_tolerance) return;
    first += static_cast<int>(line.marker_positions_m.size());
  }
  part->first_marker = first;
  lines_.push_back(target);
}

bool TargetParts::HasLengths() const {
  return first_.target.HasLengths() || std::ranges::any_of(others_, [](const auto& other) {
           return other.second.target.HasLengths();
         });
}

}  // namespace rigcal::server
