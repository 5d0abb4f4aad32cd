// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <vector>

#include "common/target/target.h"

namespace rigcal::server {

// The targets of several sessions in one bundle problem. Wands are its line target, and so is a
// point where no session has anything else; every rigid target, and a point beside another target,
// is a part of its rigid target (BundleRigidTarget). Static points are points, each at its own
// instant; surveyed ones are a rigid target at one instant. Sessions with the same marker positions
// or points share a part, and with it what is estimated of them.
class TargetParts {
 public:
  // A session's target and where it is in the problem.
  struct Part {
    Target target;
    bool is_rigid = false;  // of the rigid target; else of the line
    bool is_point = false;  // of the rigid target, and one point
    int first_marker = 0;   // of it in that target
  };

  TargetParts() : TargetParts(Target()) {}
  TargetParts(const Target& of_all)  // NOLINT(google-explicit-constructor): the usual case
      : TargetParts(of_all, {}) {}
  // `others`: by session, where it is another one than `target`.
  TargetParts(const Target& target, const std::map<std::string, Target>& others);

  // Of a session that is not known: the first target's.
  const Part& Of(const std::string& session_id) const;
  const Target& first() const { return first_.target; }
  bool is_mixed() const { return !others_.empty(); }
  // The wands, or what stands in for one, in the order of the line target; empty: every part is
  // rigid.
  const std::vector<Target>& lines() const { return lines_; }
  // Of the rigid target, and where its parts begin.
  const std::vector<TargetPoint>& points() const { return points_; }
  const std::vector<int>& first_points() const { return first_points_; }
  // Any target has lengths.
  bool HasLengths() const;

 private:
  template <typename Function>
  void ForEach(const Function& function);
  void Place(bool points_only, Part* part);
  void PlaceLine(Part* part);

  Part first_;
  std::map<std::string, Part> others_;
  std::vector<Target> lines_;
  std::vector<TargetPoint> points_;
  std::vector<int> first_points_;
};

}  // namespace rigcal::server
