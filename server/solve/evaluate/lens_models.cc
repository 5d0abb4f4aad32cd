// SPDX-License-Identifier: Apache-2.0
#include "server/solve/evaluate/lens_models.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_format.h"
#include "common/camera/camera_model.h"
#include "common/camera/fit_intrinsics.h"
#include "common/status/status_macros.h"
#include "server/solve/bundle/marker_residual_px.h"
#include "server/solve/evaluate/lens_fit.h"
#include "server/solve/evaluate/placed_views.h"
#include "server/solve/rig/intrinsics_prior.h"

namespace rigcal::server {
namespace {

constexpr int kRings = 10;
constexpr size_t kMinMarkersOfRing = 30;
constexpr int64_t kRingBlockNs = 2'000'000'000;
constexpr int kMinRingBlocks = 4;
// For models to be compared; clean recordings stay below in nine of ten, and rings this weak say
// nothing by themselves.
constexpr double kMinRingSigmas = 2;
constexpr double kMinRingShare = 0.1;
// For the given model to be wrong whatever the comparison says; far above what chance gives.
constexpr double kStrongRingSigmas = 3;
constexpr double kStrongRingShare = 0.2;
constexpr int kLensFolds = 4;
constexpr double kLensGain = 0.02;
constexpr double kLensSigmas = 2.5;
constexpr double kOwnSigmas = 1;  // of each camera, where all of them together are clear
constexpr size_t kMaxFitRays = 600;
constexpr double kMaxFitRmsPx = 20;
constexpr double kMaxAspectChange = 0.05;
constexpr size_t kMostLensGroups = 12, kMinLensGroupViews = 10, kMostLensViews = 200;
// Of a rejected marker, which a wrong model may have put there.
constexpr double kMayBeModelPx = 60;

constexpr DistortionModel kModels[] = {DistortionModel::kBrownConrady, DistortionModel::kRational,
                                       DistortionModel::kFisheye};

// Sums of radial residuals in one ring and block.
struct RingSum {
  double sum = 0;
  int count = 0;
};

struct Radial {
  double radius_px, residual_px;  // outwards
  int64_t block;
};

// By camera.
std::vector<std::vector<Radial>> RadialResiduals(const RigSolution& solution) {
  const BundleProblem& problem = solution.built.problem;
  std::vector<std::vector<Radial>> radial(problem.cameras.size());
  for (size_t i = 0; i < problem.instants.size(); ++i) {
    const BundleInstant& instant = problem.instants[i];
    ForEachUsedMarker(
        problem, instant, [&](const BundleObservation& observation, const BundleMarker& marker) {
          const auto camera = static_cast<size_t>(observation.camera);
          const IntrinsicsVector& intrinsics = problem.cameras[camera].intrinsics;
          const auto residual = MarkerResidualPx(problem, instant, observation, marker);
          const Eigen::Vector2d from_centre =
              marker.centre_px - Eigen::Vector2d(intrinsics[2], intrinsics[3]);
          const double radius_px = from_centre.norm();
          if (!residual || !(radius_px > 1)) return;
          radial[camera].push_back({radius_px, residual->dot(from_centre) / radius_px,
                                    solution.built.instant_time_ns[i] / kRingBlockNs});
        });
  }
  return radial;
}

RingResiduals RingsOf(std::vector<Radial> radial) {
  if (radial.size() < kRings * kMinMarkersOfRing) return {};
  std::ranges::sort(radial, {}, &Radial::radius_px);
  double squares = 0, mean_squares = 0, chance_squares = 0;
  int rings = 0;
  for (const Radial& each : radial) squares += each.residual_px * each.residual_px;
  for (size_t ring = 0; ring < kRings; ++ring) {
    const size_t begin = radial.size() * ring / kRings, end = radial.size() * (ring + 1) / kRings;
    std::map<int64_t, RingSum> blocks;
    double sum = 0;
    for (size_t i = begin; i < end; ++i) {
      RingSum& block = blocks[radial[i].block];
      block.sum += radial[i].residual_px;
      ++block.count;
      sum += radial[i].residual_px;
    }
    if (static_cast<int>(blocks.size()) < kMinRingBlocks) continue;
    ++rings;
    const double count = static_cast<double>(end - begin), mean = sum / count;
    // Of a ratio of sums over clusters (Cochran, Sampling Techniques, section 6.4).
    double variance = 0;
    for (const auto& [number, block] : blocks) {
      variance += std::pow(block.sum - mean * block.count, 2);
    }
    const double clusters = static_cast<double>(blocks.size());
    variance *= clusters / (clusters - 1) / (count * count);
    mean_squares += mean * mean;
    chance_squares += variance;
  }
  if (2 * rings < kRings) return {};
  if (!(chance_squares > 0)) return {};
  const double scatter2 = squares / static_cast<double>(radial.size());
  return {std::sqrt(mean_squares / rings), std::sqrt(mean_squares / rings / scatter2),
          std::sqrt(mean_squares / chance_squares)};
}

// Directions of pixels at which the camera saw the target, by its present intrinsics.
std::vector<RayPixel> SeenRays(const BundleProblem& problem, size_t camera) {
  const Intrinsics intrinsics =
      FromVector(problem.cameras[camera].model, problem.cameras[camera].intrinsics);
  std::vector<Eigen::Vector2d> pixels;
  for (const BundleInstant& instant : problem.instants) {
    ForEachUsedMarker(problem, instant,
                      [&](const BundleObservation& observation, const BundleMarker& marker) {
                        if (observation.camera == static_cast<int>(camera)) {
                          pixels.emplace_back(marker.centre_px);
                        }
                      });
  }
  std::vector<RayPixel> rays;
  const size_t stride = 1 + pixels.size() / kMaxFitRays;
  for (size_t i = 0; i < pixels.size(); i += stride) {
    const auto ray = Undistort(intrinsics, pixels[i]);
    if (ray.ok()) rays.push_back({ray->homogeneous(), pixels[i]});
  }
  return rays;
}

bool IsPlausible(const Intrinsics& intrinsics, const Intrinsics& given,
                 const std::vector<RayPixel>& rays) {
  if (!(intrinsics.fx_px > 0) || !(intrinsics.fy_px > 0)) return false;
  const double aspect = intrinsics.fy_px / intrinsics.fx_px * given.fx_px / given.fy_px;
  if (std::abs(aspect - 1) > kMaxAspectChange) return false;
  return std::ranges::all_of(
      rays, [&](const RayPixel& ray) { return Undistort(intrinsics, ray.pixel).ok(); });
}

// The lens of a camera in another model, as the solution has it; none that is plausible.
std::optional<Intrinsics> Described(DistortionModel model, const BundleProblem& problem,
                                    size_t camera) {
  const Intrinsics present =
      FromVector(problem.cameras[camera].model, problem.cameras[camera].intrinsics);
  const std::vector<RayPixel> rays = SeenRays(problem, camera);
  const auto fit = FitIntrinsics(model, rays, present);
  if (!fit.ok() || fit->rms_px > kMaxFitRmsPx) return std::nullopt;
  if (!IsPlausible(fit->intrinsics, present, rays)) return std::nullopt;
  return fit->intrinsics;
}

// A rig whose suspects have lenses of one model.
struct Candidate {
  RigObservations rig;
  RigInitialization initial;
  std::vector<bool> new_lens;
};

RigObservations WithoutRows(const RigObservations& rig) {
  RigObservations without;
  without.index = rig.index;
  return without;
}

void Describe(size_t camera, const Intrinsics& intrinsics, Candidate* candidate) {
  candidate->rig.index.cameras[camera].intrinsics = intrinsics;
  BundleCamera& begin = candidate->initial.cameras[camera];
  begin.model = intrinsics.model;
  begin.intrinsics = ToVector(intrinsics);
  candidate->new_lens[camera] = true;
}

double MeanPx(const std::vector<double>& errors_px) {
  return std::accumulate(errors_px.begin(), errors_px.end(), 0.0) /
         static_cast<double>(errors_px.size());
}

// Mean over the cameras of their mean reprojection errors, by block; infinite where one of them saw
// too little.
std::vector<double> ErrorsOf(const std::vector<size_t>& cameras,
                             const std::vector<EvaluatedErrors>& blocks) {
  std::vector<double> means_px(blocks.size(), 0);
  for (size_t b = 0; b < blocks.size(); ++b) {
    for (const size_t c : cameras) {
      const bool any = c < blocks[b].reprojection_px.size() &&
                       blocks[b].reprojection_px[c].size() >= kMinMarkersOfRing;
      means_px[b] +=
          any ? MeanPx(blocks[b].reprojection_px[c]) / static_cast<double>(cameras.size())
              : std::numeric_limits<double>::infinity();
    }
  }
  return means_px;
}

// Held-out errors by model, in the same parts of the data; infinite where there is too little.
struct ErrorsOfModels {
  std::vector<std::vector<double>> of_all;                  // by part: mean over the suspects
  std::vector<std::vector<std::vector<double>>> of_camera;  // by suspect and part
};

// In blocks of time, of which others are solved for each model.
absl::StatusOr<ErrorsOfModels> ErrorsByBlock(const std::vector<Candidate>& candidates,
                                             const std::vector<size_t>& suspects,
                                             const RigSolveOptions& options,
                                             const TimeBlocks& blocks, int count) {
  std::vector<SolveVariant> variants;
  for (const Candidate& candidate : candidates) {
    SolveVariant variant{&candidate.rig, &candidate.initial, options};
    variant.options.new_lens = candidate.new_lens;
    variants.push_back(std::move(variant));
  }
  RIGCAL_ASSIGN_OR_RETURN(const auto errors, EvaluateVariants(variants, blocks, count));
  ErrorsOfModels errors_px;
  for (const std::vector<EvaluatedErrors>& of_model : errors) {
    errors_px.of_all.push_back(ErrorsOf(suspects, of_model));
    auto& of_camera = errors_px.of_camera.emplace_back();
    for (const size_t c : suspects) of_camera.push_back(ErrorsOf({c}, of_model));
  }
  return errors_px;
}

// In groups of a camera's views of what the others place; those of all suspects one after the
// other, without those that a model cannot describe.
ErrorsOfModels ErrorsByCamera(const std::vector<Candidate>& candidates,
                              const std::vector<size_t>& suspects, const BundleProblem& problem) {
  std::vector<bool> asked(problem.cameras.size(), false);
  for (const size_t c : suspects) asked[c] = true;
  const auto views = PlaceByOthers(problem, asked, kMostLensViews, kMayBeModelPx);
  ErrorsOfModels errors_px;
  for (const Candidate& candidate : candidates) {
    std::vector<double> all;
    auto& of_camera = errors_px.of_camera.emplace_back();
    for (const size_t c : suspects) {
      const auto groups =
          static_cast<int>(std::min(kMostLensGroups, views[c].size() / kMinLensGroupViews));
      BundleCamera camera = candidate.initial.cameras[c];
      SetIntrinsicsPrior(candidate.rig.index.cameras[c], &camera, kWideIntrinsicsPrior);
      std::vector<double> own = HeldOutErrorsPx(views[c], camera, groups);
      own.resize(static_cast<size_t>(groups), std::numeric_limits<double>::infinity());
      all.insert(all.end(), own.begin(), own.end());
      of_camera.push_back(std::move(own));
    }
    errors_px.of_all.push_back(std::move(all));
  }
  return errors_px;
}

// A model for the suspects.
struct ComparedModel {
  size_t variant = 0;
  int coefficients = 0;
  bool is_clear = false;  // better than the present ones
  HeldOutGain gain;
};

double HeldOutPx(const ComparedModel& model) { return model.gain.after_px; }

// Where one is clearly better: of the models that are as good as the best of these within one
// standard error, that with fewest coefficients (Breiman et al., Classification and Regression
// Trees, 1984, section 3.4.3). Else the best. `models`: one at least.
const ComparedModel& ChosenOf(const std::vector<ComparedModel>& models) {
  std::vector<ComparedModel> clear;
  std::ranges::copy_if(models, std::back_inserter(clear), &ComparedModel::is_clear);
  if (clear.empty()) return *std::ranges::min_element(models, {}, HeldOutPx);
  const HeldOutGain best = std::ranges::min_element(clear, {}, HeldOutPx)->gain;
  const ComparedModel* simplest = nullptr;
  for (const ComparedModel& model : models) {
    if (HeldOutPx(model) > best.after_px + best.sigma_px) continue;
    if (simplest == nullptr || model.coefficients < simplest->coefficients) simplest = &model;
  }
  return *simplest;
}

}  // namespace

std::vector<RingResiduals> MeasureRings(const RigSolution& solution) {
  std::vector<RingResiduals> rings;
  for (std::vector<Radial>& radial : RadialResiduals(solution)) {
    rings.push_back(RingsOf(std::move(radial)));
  }
  return rings;
}

absl::StatusOr<std::vector<BetterLens>> FindBetterLenses(const RigObservations& rig,
                                                         const RigSolution& solution,
                                                         const RigSolveOptions& options,
                                                         bool by_camera) {
  std::vector<BetterLens> better;
  const std::vector<RingResiduals> rings = MeasureRings(solution);
  std::vector<size_t> suspects;
  for (size_t c = 0; c < rings.size(); ++c) {
    const bool is_new = c < options.new_lens.size() && options.new_lens[c];
    // A held camera's lens is that of the earlier calibration.
    if (options.held != nullptr && options.held->Holds(c)) continue;
    if (!is_new && rings[c].sigmas > kMinRingSigmas && rings[c].share > kMinRingShare) {
      suspects.push_back(c);
    }
  }
  if (suspects.empty()) return better;
  const BundleProblem& problem = solution.built.problem;
  const auto [first, last] = std::ranges::minmax_element(solution.built.instant_time_ns);
  TimeBlocks blocks = LongBlocks(*first, *last);
  // The more data a solve has, the less its model has to tell beyond them.
  blocks.period = kLensFolds;
  const int count = CountBlocks(blocks, *last);

  // The present models first, refined as freely as the others.
  std::vector<Candidate> candidates;
  std::vector<std::optional<DistortionModel>> tried(1);
  tried.insert(tried.end(), std::begin(kModels), std::end(kModels));
  for (const std::optional<DistortionModel> model : tried) {
    Candidate candidate{by_camera ? WithoutRows(rig) : rig, InitializationFrom(solution),
                        options.new_lens};
    candidate.new_lens.resize(problem.cameras.size(), false);
    for (const size_t c : suspects) {
      candidate.new_lens[c] = true;
      if (!model || *model == problem.cameras[c].model) continue;
      if (const auto lens = Described(*model, problem, c)) Describe(c, *lens, &candidate);
    }
    candidates.push_back(std::move(candidate));
  }
  ErrorsOfModels errors_px;
  if (by_camera) {
    errors_px = ErrorsByCamera(candidates, suspects, problem);
  } else {
    RIGCAL_ASSIGN_OR_RETURN(errors_px, ErrorsByBlock(candidates, suspects, options, blocks, count));
  }
  // All suspects together: cameras of a rig mostly have lenses of one kind, and one that is
  // described wrongly spoils the others' errors.
  std::vector<ComparedModel> models;
  for (size_t v = 1; v < candidates.size(); ++v) {
    const bool is_other = std::ranges::any_of(suspects, [&](size_t c) {
      return candidates[v].rig.index.cameras[c].intrinsics->model != problem.cameras[c].model;
    });
    const HeldOutGain gain = CompareByBlock(errors_px.of_all[0], errors_px.of_all[v]);
    if (!is_other || gain.blocks == 0) continue;
    models.push_back(
        {v, CoefficientCount(kModels[v - 1]), gain.IsClear(kLensGain, kLensSigmas), gain});
  }
  if (models.empty()) return better;
  const bool any_clear = std::ranges::any_of(models, &ComparedModel::is_clear);
  const size_t chosen = ChosenOf(models).variant;
  for (size_t s = 0; s < suspects.size(); ++s) {
    const size_t c = suspects[s];
    const Intrinsics& intrinsics = *candidates[chosen].rig.index.cameras[c].intrinsics;
    if (intrinsics.model == problem.cameras[c].model) continue;
    const HeldOutGain gain =
        CompareByBlock(errors_px.of_camera[0][s], errors_px.of_camera[chosen][s]);
    const bool is_clear = any_clear && gain.IsClear(0, kOwnSigmas);
    const bool is_strong = rings[c].sigmas > kStrongRingSigmas && rings[c].share > kStrongRingShare;
    if (!is_clear && !(is_strong && gain.IsClear(kLensGain, 0))) continue;
    better.push_back({c, is_clear, intrinsics, gain, rings[c]});
  }
  return better;
}

Finding FindingOf(const RigObservations& rig, const BetterLens& lens, bool is_used) {
  const CameraDescription& camera = rig.index.cameras[lens.camera];
  const std::string given(DistortionModelName(camera.intrinsics->model));
  const std::string found(DistortionModelName(lens.intrinsics.model));
  const std::string errors =
      absl::StrFormat("%.2f instead of %.2f px (+-%.2f px)", lens.gain.after_px,
                      lens.gain.before_px, lens.gain.sigma_px);
  std::string advice = absl::StrFormat(
      "its lens is not of the model %s: what it sees lies too near to the middle of the image at "
      "some distances from it and too far at others, by %.2f px (%.1f sigmas)",
      given, lens.rings.rms_px, lens.rings.sigmas);
  if (is_used) {
    advice += absl::StrFormat(
        ". The calibration describes it by %s, whose held-out error is %s. Calibrate the lens by "
        "that model",
        found, errors);
  } else if (lens.is_clear) {
    advice += absl::StrFormat(
        ". The model %s describes it better, with a held-out error of %s. Calibrate the lens by "
        "it, or calibrate without the option for intrinsics, which then uses it",
        found, errors);
  } else {
    advice += absl::StrFormat(
        ". The model %s may describe it better (held-out error %s), which these data cannot "
        "decide. Calibrate the lens by it, or wave through all of its image",
        found, errors);
  }
  return {FindingKind::kWrongLensModel, camera.camera, lens.rings.rms_px, "px", advice};
}

RigObservations WithLenses(const RigObservations& rig, const std::vector<BetterLens>& lenses) {
  RigObservations changed = rig;
  for (const BetterLens& lens : lenses) {
    changed.index.cameras[lens.camera].intrinsics = lens.intrinsics;
    for (size_t t = 0; t < changed.tracks.size(); ++t) {
      if (changed.index.camera_of_track[t] != static_cast<int>(lens.camera)) continue;
      changed.tracks[t].track.camera.intrinsics = lens.intrinsics;
    }
  }
  return changed;
}

}  // namespace rigcal::server
