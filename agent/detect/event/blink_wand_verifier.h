// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "absl/types/span.h"
#include "agent/detect/event/blink_wand_track.h"
#include "agent/detect/event/burst_measurer.h"
#include "agent/detect/event/entering_pair.h"
#include "agent/identify/wand_finder.h"
#include "common/target/detection_outcome.h"

namespace rigcal::agent {

struct BlinkWand {
  DetectionOutcome outcome = DetectionOutcome::kNoBlob;
  // With kWand: as the target's markers lie; time_delta_ns is not set yet.
  absl::InlinedVector<MarkerObservation, 3> markers;
  absl::InlinedVector<double, 3> times_us;  // by marker: lower 32 bits of the sensor's clock
  double confidence = 0;                    // 0 to 1, of the whole wand
  int blob_count = 0;
  std::vector<int> blobs;  // by marker, of the verifier; -1: not seen
  // With kWand: one of its blobs is beside a gap; the least share of its whole blobs (BlinkBlob).
  bool is_beside_gap = false;
  double answered_share = 1;
  bool is_timed = false;  // with kWand: all its blobs are (BlinkBlob::is_timed)
  // Of a blink, the share in which the middle marker is lit; none where that was not measured.
  std::optional<double> lit_share;
};

// Chooses the wand among blobs that blink at its frequency: the candidate of WandFinder whose pose
// explains places and sizes best, given the accuracy that a burst of light allows. A centre's
// variance goes with the number of its pixels: each of the 2 pi r pixels along the rim of a disc is
// in or out by chance, which moves the centroid by a variance of w / (4 pi r), w the width of the
// rim that is uncertain. Along the motion the mean of rise and fall (FlashMeasurer) is not quite in
// the middle. Of markers that touch each other, pixels between them may belong to the other one.
//
// A wand of three markers or more of which not all are seen (hidden, cut by the border, out of the
// image) is delivered if it was followed until then: two or more whole blobs where markers were
// expected, none else there, that fit the wand's lengths and sizes. Two blobs alone do not say
// which markers they are, unless the third one can only be beyond the border (FindEnteringPair).
// While other blobs are seen that may be another wand's, it is not.
//
// Two wands whose markers can all be seen are refused as ambiguous: which one other cameras see is
// not known here.
//
// Markers that blink at several frequencies (WandFinderOptions::marker_kinds holds what each marker
// has as BlinkBlob::frequency) are seen at different times, so that a moving wand's do not lie
// quite as they should; it is allowed what such a wand moves. One thread at a time.
class BlinkWandVerifier {
 public:
  // Only the largest blobs are considered.
  static constexpr int kMaxBlobs = 256;

  // Target and camera must be valid.
  BlinkWandVerifier(const WandFinderOptions& options, const Target& target,
                    const CameraDescription& camera)
      : finder_(options, target, camera),
        min_confidence_(options.limits.min_confidence),
        geometry_{camera.image_size_px.width, camera.image_size_px.height},
        marker_kinds_(options.marker_kinds) {}

  BlinkWand Verify(const std::vector<BlinkBlob>& blobs);
  // The clock jumps.
  void ForgetTrack() {
    track_.Forget();
    ambiguous_us_.reset();
    alone_us_.reset();
  }

 private:
  struct Evaluated {
    const WandCandidate* candidate = nullptr;
    WandImageFit fit;
  };
  void TakeBlobs(const std::vector<BlinkBlob>& blobs);
  bool Refit(const WandCandidate& candidate, Evaluated* evaluated) const;
  // What is known of the wand by the light of one of its blobs.
  void TakeLight(int blob, BlinkWand* wand) const;
  MarkerObservation Observe(const WandImageFit& fit, size_t marker, int blob) const;
  // From the whole wand's candidates.
  BlinkWand Choose();
  // From two or more blobs where the track expects markers; kNoWand if there are none.
  BlinkWand Follow() const;
  // From the only two whole blobs, of a wand that comes into the image; kNoWand if it is not one.
  BlinkWand Enter() const;
  bool DifferInCutOnly(absl::Span<const int> a, absl::Span<const int> b) const;
  bool IsBesideAnother(absl::Span<const int> wand);
  // Blobs that are large enough to be another wand's markers.
  int OthersThan(absl::Span<const int> wand) const;
  // The one blob that can be this marker; -1: none or several.
  int FindFollowed(size_t marker) const;
  MarkerSight SightOf(int blob) const;
  void UpdateTrack(const BlinkWand& wand);

  WandFinder finder_;
  double min_confidence_;
  SensorGeometry geometry_;
  std::vector<int> marker_kinds_;
  std::vector<Blob> blobs_;
  std::vector<BlinkBlob> seen_;   // blobs_ with what is known of their light
  std::vector<int> frequencies_;  // of blobs_
  std::vector<int> order_;
  std::vector<Evaluated> evaluated_;
  BlinkWandTrack track_;
  std::optional<double> ambiguous_us_;  // when another wand was seen last
  std::optional<double> alone_us_;      // when a wand was seen without any other blobs
};

}  // namespace rigcal::agent
