// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>
#include <vector>

#include "agent/identify/measured_markers.h"
#include "agent/identify/verified_wand.h"
#include "agent/identify/wand_choice.h"
#include "agent/identify/wand_finder.h"
#include "agent/identify/wand_mechanisms.h"

namespace rigcal::agent {

// A candidate that was examined, for an explanation.
struct WandTrial {
  VerifiedWand wand;         // as far as it was measured
  std::string_view refusal;  // why it was not scored; empty if it was
  bool is_lit = false;
};

// Chooses among candidates by what is measured of them: sub-pixel centres and radii against the
// pose, outlines against those of spheres, and how alike the markers are in brightness and colour
// (ChooseWand). One thread at a time.
class WandVerifier {
 public:
  // Log-odds that one unit of a candidate's cost takes before it is measured; and by how much more
  // cost than another's a candidate need not be measured.
  static constexpr double kCostLogOdds = 0.4, kClearlyWorse = 8;

  explicit WandVerifier(double min_confidence, const WandMechanisms& without = {})
      : min_confidence_(min_confidence), without_(without) {}

  // Adds every candidate that Verify examines to `trials` from now on; null: none.
  void Record(std::vector<WandTrial>* trials) { trials_ = trials; }

  // Call before the first Verify of an image; later ones use what was measured of it.
  void StartImage() { markers_.StartImage(); }

  // The candidates are sorted by cost; those clearly worse than a wand that was found are not
  // measured. `in_room`: the room is lit, and much in it is as large as a small sphere. `pixels`
  // are those that may be read (MarkerMeter::WorkOf), and are reduced by those that were; what
  // would take more is left out. The wand's centres are those of a first look, for FitOutlines.
  Verdict Verify(const ImageView& image, absl::Span<const Blob> blobs, const WandFinder& finder,
                 absl::Span<const WandCandidate> candidates, bool in_room, double* pixels);
  // Sets the centres of the last Verify's wand from outlines, where these can be fitted. Returns
  // false if they show that fewer than two of its markers are whole, so that it is no wand.
  [[nodiscard]] bool FitOutlines(const ImageView& image, VerifiedWand* wand);

 private:
  // Measures a candidate except for its outlines. Returns null, or why it is no wand.
  const char* EvaluateOne(const ImageView& image, absl::Span<const Blob> blobs,
                          const WandFinder& finder, const WandCandidate& candidate,
                          VerifiedWand* wand);
  bool IsKnown(const WandCandidate& candidate, absl::Span<const Blob> blobs) const;
  static bool FitPose(const WandFinder& finder, VerifiedWand* wand);
  // Computes log-odds and confidence, with what the outlines say.
  void Score(const ImageView& image, VerifiedWand* wand);

  double min_confidence_;
  WandMechanisms without_;
  bool in_room_ = false;
  MeasuredMarkers markers_;
  std::vector<VerifiedWand> evaluated_;
  std::vector<WandTrial>* trials_ = nullptr;
};

}  // namespace rigcal::agent
