// SPDX-License-Identifier: Apache-2.0
// What the detector of frame cameras, and each of its mechanisms, is worth to a calibration: a rig
// of four cameras sees a wave of the wand in different rooms, the detector's rows are calibrated,
// and the result is compared with the truth. With --without the same frames are searched again with
// a mechanism left out.
#include "tests/accuracy/detection/detection_value.h"

#include <fmt/core.h>

#include <algorithm>
#include <memory>
#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "tests/accuracy/detection/detection_experiments.h"

namespace rigcal::accuracy {
namespace {

using agent::WandMechanism;

struct NamedMechanism {
  const char* name;
  WandMechanism mechanism;
};
const NamedMechanism kMechanisms[] = {
    {"restored_outlines", WandMechanism::kRestoredOutlines},
    {"lambert", WandMechanism::kLambertShading},
    {"other_spheres", WandMechanism::kOtherSpheres},
    {"pale_levels", WandMechanism::kPaleLevels},
};
constexpr const char* kBackground = "static_background";

constexpr const char* kRooms[] = {
    "dark",         "office",          "bright office",        "people in orange",
    "office, 1 ms", "office, defocus", "office, rolling, JPEG"};

struct Arguments {
  DetectionValueOptions options;
  std::string without, only;
  int seed = 1, seeds = 1;
};

absl::StatusOr<std::vector<DetectorVariant>> VariantsOf(const std::string& without) {
  std::vector<DetectorVariant> variants = {{.name = "today", .without = {}}};
  if (without == "each") {
    for (DetectorVariant& one : MechanismVariants()) variants.push_back(std::move(one));
    return variants;
  }
  for (const std::string& names :
       std::vector<std::string>(absl::StrSplit(without, ',', absl::SkipEmpty()))) {
    auto variant = VariantWithout(names);
    if (!variant.ok()) return variant.status();
    variants.push_back(*std::move(variant));
  }
  return variants;
}

void PrintValue(const std::string& name, const DetectionValue& value) {
  fmt::print("  {:30} {:5} {:6.1f} {:6} {:6.3f} {:6.3f} {:6.2f} ", name, value.views,
             100 * value.views_share, value.false_wands, value.rms_px, value.bias_px, value.nees);
  if (value.solved.ok()) {
    fmt::print("{:7.3f} {:7.3f}", value.worst_mm, value.rms_mm);
  } else {
    fmt::print("{:>15}", "not solved");
  }
  fmt::print(" {:7.2f} {:6.2f}\n", value.median_ms, value.worst_ms);
  if (!value.solved.ok()) fmt::print("    {}\n", std::string(value.solved.message()));
}

// Of several seeds: means of the errors, sums of the counts, the poorest camera's views.
DetectionValue MeanOf(const std::vector<DetectionValue>& seeds) {
  DetectionValue mean = seeds.front();
  for (size_t i = 1; i < seeds.size(); ++i) {
    const DetectionValue& other = seeds[i];
    const double share = 1.0 / static_cast<double>(i + 1);
    const auto average = [share](double* value, double its) { *value += share * (its - *value); };
    mean.frames += other.frames;
    mean.shown += other.shown;
    mean.views = std::min(mean.views, other.views);
    mean.views_share = std::min(mean.views_share, other.views_share);
    mean.false_wands += other.false_wands;
    average(&mean.rms_px, other.rms_px);
    average(&mean.bias_px, other.bias_px);
    average(&mean.nees, other.nees);
    mean.solved.Update(other.solved);
    average(&mean.worst_mm, other.worst_mm);
    average(&mean.rms_mm, other.rms_mm);
    average(&mean.median_ms, other.median_ms);
    mean.worst_ms = std::max(mean.worst_ms, other.worst_ms);
  }
  return mean;
}

int Run(const Arguments& arguments) {
  const auto variants = VariantsOf(arguments.without);
  if (!variants.ok()) {
    fmt::print(stderr, "{}\n", std::string(variants.status().message()));
    return 2;
  }
  DetectionValueOptions options = arguments.options;
  fmt::print(
      "{} cameras at {} Hz, {} s without a wand, then {} s of waving; views: of the poorest "
      "camera,\nand as a share of its frames (20 % are 600 a minute at 50 Hz)\n\n"
      "                                    views        false      centres, px           camera "
      "error, mm      ms\n"
      "                                    n      %   wands    rms   bias   NEES    worst     rms  "
      "median  worst\n",
      options.camera_count, options.rate_hz, options.empty_s, options.duration_s);
  for (const DetectionCase& room : ValueRooms()) {
    if (!arguments.only.empty() && room.name.find(arguments.only) == std::string::npos) continue;
    std::vector<std::vector<DetectionValue>> of_variants(variants->size());
    for (int k = 0; k < arguments.seeds; ++k) {
      options.seed = static_cast<uint32_t>(arguments.seed + k);
      const auto values = RunDetectionValue(options, room, *variants);
      if (!values.ok()) {
        fmt::print(stderr, "{}: {}\n", room.name, values.status().ToString());
        return 1;
      }
      for (size_t v = 0; v < values->size(); ++v) of_variants[v].push_back((*values)[v]);
    }
    for (size_t v = 0; v < of_variants.size(); ++v) {
      const DetectionValue value = MeanOf(of_variants[v]);
      if (v == 0) {
        fmt::print("{}: {} frames, {} with two spheres or more in the image\n", room.name,
                   value.frames, value.shown);
      }
      PrintValue((*variants)[v].name, value);
    }
    std::fflush(stdout);
  }
  return 0;
}

Experiment::Run Prepare(OptionList* list) {
  const auto arguments = std::make_shared<Arguments>();
  DetectionValueOptions& options = arguments->options;
  list->Add("--without", &arguments->without,
            "mechanisms to leave out, `a,b+c`: first a, then b and c together; `each`: one after "
            "another");
  list->Add("--only", &arguments->only, "rooms with this in their name");
  list->Add("--seed", &arguments->seed, 0, 4000000, "of rig, wave, rooms and noise");
  list->Add("--seeds", &arguments->seeds, 1, 100,
            "from that one on: one calibration's largest error says little; means are printed");
  list->Add("--cameras", &options.camera_count, 2, 100, "of the rig");
  list->Add("--rate", &options.rate_hz, 1, 100, "frames of each camera, Hz");
  list->Add("--empty", &options.empty_s, 0, 600, "the room without a wand, before the wave, s");
  list->Add("--duration", &options.duration_s, 1, 3600, "of the wave, s");
  list->Add("--threads", &options.threads, 1, 256, "cameras at the same time");
  return [arguments] { return Run(*arguments); };
}

}  // namespace

// One for each of kRooms: the first whose name begins so.
std::vector<DetectionCase> ValueRooms() {
  const std::vector<DetectionCase> all = RoomCases({});
  std::vector<DetectionCase> rooms;
  for (const char* const name : kRooms) {
    rooms.push_back(*std::ranges::find_if(
        all, [&](const DetectionCase& room) { return room.name.starts_with(name); }));
  }
  return rooms;
}

std::vector<DetectorVariant> MechanismVariants() {
  std::vector<DetectorVariant> variants;
  for (const NamedMechanism& one : kMechanisms) {
    variants.push_back({.name = absl::StrCat("without ", one.name), .without = {}});
    variants.back().without.Insert(one.mechanism);
  }
  variants.push_back(
      {.name = absl::StrCat("without ", kBackground), .without = {}, .background = false});
  return variants;
}

absl::StatusOr<DetectorVariant> VariantWithout(const std::string& names) {
  DetectorVariant variant{.name = absl::StrCat("without ", names), .without = {}};
  for (const std::string& name : std::vector<std::string>(absl::StrSplit(names, '+'))) {
    if (name == kBackground) {
      variant.background = false;
      continue;
    }
    const auto* const known = std::ranges::find_if(
        kMechanisms, [&](const NamedMechanism& one) { return one.name == name; });
    if (known == std::end(kMechanisms)) {
      return absl::InvalidArgumentError(absl::StrCat(
          "no mechanism ", name, "; there are ",
          absl::StrJoin(
              kMechanisms, ", ",
              [](std::string* out, const NamedMechanism& one) { absl::StrAppend(out, one.name); }),
          ", ", kBackground));
    }
    variant.without.Insert(known->mechanism);
  }
  return variant;
}

Experiment DetectionValueExperiment() {
  return {"detection_value", "what each mechanism of the detector is worth to a calibration",
          Prepare};
}

}  // namespace rigcal::accuracy
