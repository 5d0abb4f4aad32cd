// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "absl/container/inlined_vector.h"
#include "absl/types/span.h"
#include "agent/detect/blobs/blob_finder.h"
#include "agent/identify/ray_table.h"
#include "agent/identify/wand_image_fit.h"
#include "common/camera/camera_description.h"
#include "common/status/fault_list.h"
#include "common/target/observation.h"
#include "common/target/target.h"

namespace rigcal::agent {

// Limits of what may be a wand.
struct WandLimits {
  // Distances of every marker, metres; 2.5 times as wide without intrinsics.
  double min_distance_m = 0.3;
  double max_distance_m = 20;
  // Tilt of the wand out of the plane across the line of sight, 10 to 89 degrees. Larger tilts make
  // short, uncertain wands.
  double max_tilt_deg = 82;
  double min_confidence = 0.5;  // 0 to 1; less is no wand

  // Adds every fault.
  void Check(FaultList* faults) const;
};

struct WandFinderOptions {
  WandLimits limits;
  int max_candidates = 40;  // those of least cost are kept
  int max_fits = 100000;    // poses that are fitted, a few microseconds each
  // By marker: the kind of blob that it appears as (its blink frequency). Empty: any.
  std::vector<int> marker_kinds = {};
};

// Blobs that can be the target's markers.
struct WandCandidate {
  absl::InlinedVector<int, 3> blobs;  // by marker: index into the blobs given to Find
  WandImageFit fit;
  double cost = 0;  // before it is measured; from Find: of the fit and the doubts
};

// Tells whether both have the same blobs, in whatever order.
bool SameBlobs(const absl::InlinedVector<int, 3>& a, const absl::InlinedVector<int, 3>& b);

// Fails with INVALID_ARGUMENT if the target or the camera's intrinsics are not valid.
absl::Status CheckTargetAndCamera(const Target& target, const CameraDescription& camera);

// Looks for the target among blobs: it takes every pair that can be the two ends and, between them,
// a blob where each inner marker can be seen in perspective; the cost is that of the best pose
// (FitWand). The size of a blob counts in relation to its distance. A target of one marker takes
// every round blob. Both orientations are listed if both are possible. One thread at a time.
class WandFinder {
 public:
  // Target and camera must be valid. Without intrinsics it assumes a lens of usual width without
  // distortion, and tests less strictly.
  WandFinder(const WandFinderOptions& options, const Target& target,
             const CameraDescription& camera);

  // Returns the candidates by the costs of pose and doubts, then by blob; valid until the next
  // call. By blob: `kinds` (WandFinderOptions::marker_kinds); `colours`, grey levels by channel
  // (blobs with clearly different ones are not one wand's); `doubts`, a chi-squared against its
  // being a sphere. Ends that are alike and not doubtful are tried first.
  const std::vector<WandCandidate>& Find(absl::Span<const Blob> blobs,
                                         absl::Span<const int> kinds = {},
                                         absl::Span<const Eigen::Vector3f> colours = {},
                                         absl::Span<const double> doubts = {});

  // Sets ray and scale around `centre_px`; the rest stays. False if the lens has no ray there.
  bool Sight(const Eigen::Vector2d& centre_px, MarkerSight* sight) const;
  // Projects `point` (frame `cam`, any scale) into the image. False if the lens has no ray there.
  bool ImageOf(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) const;
  const WandImageFitOptions& fit_options() const { return fit_options_; }
  absl::Span<const double> shares() const { return shares_; }  // along the wand, 0 to 1
  double length_m() const { return length_m_; }
  void LimitFits(int max_fits) { options_.max_fits = max_fits; }
  int fits() const { return fits_; }                             // of the last Find
  bool cut_short() const { return fits_ >= options_.max_fits; }  // max_fits ended the last Find
  // About the least cost, by likeness and doubts, of what max_fits made the last Find leave out.
  double least_cost_left() const { return least_cost_left_; }
  // Moves the image's centre to the projection of the sphere's, if lens and diameter are known.
  void ToSphereCentre(const WandImageFit& fit, size_t marker, MarkerObservation* observed) const;

 private:
  struct Entry {
    int blob = 0;
    int kind = 0;
    MarkerSight sight;
    Eigen::Vector2d flat_px;  // place in an image without distortion, where lines are straight
    Eigen::Vector3f colour = Eigen::Vector3f::Zero();  // of length 1
    float brightness = 0;                              // natural logarithm
    double doubt = 0;
  };
  struct Pair {
    float unlikeness;
    int first, last;
  };
  void AddEntry(int index, const Blob& blob, int kind);
  int IndexOf(const Entry& entry) const { return static_cast<int>(&entry - entries_.data()); }
  bool CanBe(const Entry& entry, size_t marker) const {
    return options_.marker_kinds.empty() || options_.marker_kinds[marker] == entry.kind;
  }
  bool CanBeEnds(const Entry& first, const Entry& last) const {
    return CanBe(first, 0) && CanBe(last, shares_.size() - 1);
  }
  void FillCells();
  void ListPairs();
  // Returns the difference in brightness and colour as a chi-squared.
  static float Unlikeness(const Entry& a, const Entry& b);
  bool EndsPossible(const Entry& a, const Entry& b) const;
  void SearchBetween(const Entry& first, const Entry& last);
  // Lists the entries near a piece of the line between two points in flat_px.
  void Near(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double reach_px,
            std::vector<int>* found) const;
  void Complete(const Entry& first, const Entry& second, const Entry& last);
  void Offer(const absl::InlinedVector<int, 3>& entries);

  WandFinderOptions options_;
  WandImageFitOptions fit_options_;
  Intrinsics intrinsics_;
  std::shared_ptr<const RayTable> rays_;  // shared by copies of a finder
  double focal_px_ = 1;
  double length_m_ = 1;
  std::vector<double> shares_;
  std::vector<Entry> entries_;
  std::vector<Pair> pairs_;
  std::vector<int> cell_first_, cell_entries_;  // entries by cell of a grid over flat_px
  Eigen::Vector2d grid_origin_ = Eigen::Vector2d::Zero();
  int grid_width_ = 0, grid_height_ = 0;
  std::vector<int> between_;
  int fits_ = 0;  // since Find began
  double least_cost_left_ = 0;
  std::vector<WandCandidate> candidates_;
};

}  // namespace rigcal::agent
