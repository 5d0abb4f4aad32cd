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

// What may be a wand.
struct WandLimits {
  // Of every marker, where intrinsics and spacing are known; metres.
  double min_distance_m = 0.3;
  double max_distance_m = 20;
  // Of the wand out of the plane across the line of sight; more makes short, uncertain wands. 10 to
  // 89 degrees.
  double max_tilt_deg = 82;
  double min_confidence = 0.5;  // less is no wand, 0 to 1

  // Adds every fault.
  void Check(FaultList* faults) const;
};

struct WandFinderOptions {
  WandLimits limits;
  int max_candidates = 40;  // those of least cost are kept
  int max_fits = 100000;    // poses that are tried, a few microseconds each
  // By marker: the kind of blob it appears as (its blink frequency). Empty:
  // any blob can be any marker.
  std::vector<int> marker_kinds = {};
};

// Blobs that can be the target's markers.
struct WandCandidate {
  absl::InlinedVector<int, 3> blobs;  // by marker: index into what was given to Find
  WandImageFit fit;
  double cost = 0;  // as is known before it is measured; of the finder: of fit and doubts
};

// In whatever order.
bool SameBlobs(const absl::InlinedVector<int, 3>& a, const absl::InlinedVector<int, 3>& b);

// INVALID_ARGUMENT: the target or the camera's intrinsics are not valid.
absl::Status CheckTargetAndCamera(const Target& target, const CameraDescription& camera);

// Looks for the target among blobs: every pair that can be the two ends, and between them a blob
// where each inner marker can be seen in perspective; then the cost of the best pose (FitWand). How
// large a blob is compared with other blobs means nothing, how large it is for its distance does.
// One marker: every blob of round shape. Both orientations are listed where both are possible. One
// thread at a time.
class WandFinder {
 public:
  // The target and camera must be valid. Without intrinsics a lens of usual width without
  // distortion is assumed, and the tests are wider.
  WandFinder(const WandFinderOptions& options, const Target& target,
             const CameraDescription& camera);

  // By the costs of pose and doubts, then by blob. `kinds`, of each blob, with
  // WandFinderOptions::marker_kinds. `colours`, of each blob: grey levels by channel; blobs that
  // clearly differ in it are not one wand's. `doubts`, of each blob: that it is a sphere, as a
  // chi-squared. The most alike and least doubtful are tried first. Until the next call.
  const std::vector<WandCandidate>& Find(absl::Span<const Blob> blobs,
                                         absl::Span<const int> kinds = {},
                                         absl::Span<const Eigen::Vector3f> colours = {},
                                         absl::Span<const double> doubts = {});

  // Sets ray and scale of a marker's image around `centre_px`; the rest stays.
  // False where the lens has no ray.
  bool Sight(const Eigen::Vector2d& centre_px, MarkerSight* sight) const;
  // Where a point is seen; `point` in frame `cam`, of any scale. False where the lens has no ray.
  bool ImageOf(const Eigen::Vector3d& point, Eigen::Vector2d* pixel) const;
  const WandImageFitOptions& fit_options() const { return fit_options_; }
  absl::Span<const double> shares() const { return shares_; }  // along the wand, 0 to 1
  double length_m() const { return length_m_; }
  void LimitFits(int max_fits) { options_.max_fits = max_fits; }
  int fits() const { return fits_; }                             // of the last Find
  bool cut_short() const { return fits_ >= options_.max_fits; }  // the last Find, by max_fits
  // Of what the last Find left out for that: about the least cost of its likeness and doubts.
  double least_cost_left() const { return least_cost_left_; }
  // Moves the centre of a marker's image to the projection of the sphere's centre, where lens and
  // diameter are known.
  void ToSphereCentre(const WandImageFit& fit, size_t marker, MarkerObservation* observed) const;

 private:
  struct Entry {
    int blob = 0;
    int kind = 0;
    MarkerSight sight;
    Eigen::Vector2d flat_px;  // image without distortion: lines are straight
    Eigen::Vector3f colour = Eigen::Vector3f::Zero();  // of length 1
    float brightness = 0;                              // its logarithm
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
  // As a chi-squared.
  static float Unlikeness(const Entry& a, const Entry& b);
  bool EndsPossible(const Entry& a, const Entry& b) const;
  void SearchBetween(const Entry& first, const Entry& last);
  // Entries near a piece of the line between two points in flat_px.
  void Near(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double reach_px,
            std::vector<int>* found) const;
  void Complete(const Entry& first, const Entry& second, const Entry& last);
  void Offer(const absl::InlinedVector<int, 3>& entries);

  WandFinderOptions options_;
  WandImageFitOptions fit_options_;
  Intrinsics intrinsics_;
  std::shared_ptr<const RayTable> rays_;  // copies of a finder share it
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
