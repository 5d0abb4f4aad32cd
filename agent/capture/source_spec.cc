// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_spec.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "agent/capture/genicam/aravis_frame_source.h"
#include "agent/capture/metavision/metavision_event_source.h"
#include "agent/capture/source_kinds.h"
#include "common/camera/camera_id.h"
#include "common/status/status_macros.h"
#include "common/text/shortest_text.h"

namespace rigcal::agent {
namespace {

constexpr std::array kKinds = {
    SourceKind{"csv:", true, "left=csv:rig/left.csv;speed=max;sigma=0.5", ParseCsvSource},
    SourceKind{"sim:", false, "sim:camera=0;seed=1;cameras=6;speed=max", ParseSimulatedSource},
    SourceKind{"images:", true, "left=images:rig/left;fps=25;hue_max=40", ParseImagesSource},
    SourceKind{"video:", true, "left=video:rig/left.mkv;speed=max", ParseVideoSource},
    SourceKind{"aravis:", true, "left=aravis:192.168.1.5;exposure=0.004", ParseAravisSource},
    SourceKind{"raw:", true, "left=raw:rig/left.raw;rate=200;trigger=rising", ParseRawSource},
    SourceKind{"metavision:", false, "left=metavision:serial=00050423;biases=biases.toml;rate=200",
               ParseMetavisionSource},
};
static_assert(kKinds.size() == kSourceKindNames.size());

absl::Status Fault(std::string_view text, const std::string& what, std::string_view example) {
  return absl::InvalidArgumentError(absl::StrCat("source \"", std::string(text), "\": ", what,
                                                 "; example: ", std::string(example)));
}

const SourceKind* FindKind(std::string_view text) {
  const auto* const found = std::find_if(kKinds.begin(), kKinds.end(), [&](const SourceKind& kind) {
    return text.starts_with(kind.prefix);
  });
  return found == kKinds.end() ? nullptr : found;
}

absl::StatusOr<SourceText> SplitText(const SourceKind& kind, std::string_view name,
                                     std::string_view body) {
  SourceText text{.name = std::string(name), .subject = "", .options = {}};
  std::vector<std::string> parts = absl::StrSplit(std::string(body), ';');
  if (kind.has_subject) {
    text.subject = parts.front();
    parts.erase(parts.begin());
  } else {
    std::erase(parts, "");
  }
  RIGCAL_ASSIGN_OR_RETURN(text.options, SourceOptions::Split(parts));
  return text;
}

absl::StatusOr<SourceSpec> Parse(std::string_view text, const std::vector<SourceOption>& over) {
  std::string_view name;
  std::string_view rest = text;
  if (const size_t equals = text.find('=');
      FindKind(text) == nullptr && equals != std::string_view::npos) {
    name = text.substr(0, equals);
    rest = text.substr(equals + 1);
    if (name.empty()) return Fault(text, "there is no name before '='", kKinds.front().example);
  }
  const SourceKind* kind = FindKind(rest);
  if (kind == nullptr) {
    return Fault(
        text, absl::StrCat("\"", std::string(rest), "\" begins with none of ", ListOfSourceKinds()),
        kKinds.front().example);
  }
  absl::StatusOr<SourceText> split = SplitText(*kind, name, rest.substr(kind->prefix.size()));
  if (!split.ok()) return Fault(text, std::string(split.status().message()), kind->example);
  for (const SourceOption& option : over) split->options.Override(option);
  absl::StatusOr<SourceSpec> spec = kind->parse(*std::move(split));
  if (!spec.ok()) return Fault(text, std::string(spec.status().message()), kind->example);
  if (const absl::Status status = ValidateName("camera name", CameraNameOf(*spec)); !status.ok()) {
    return Fault(text, std::string(status.message()), kind->example);
  }
  return spec;
}

std::string SpeedText(double speed) { return std::isinf(speed) ? "max" : ShortestText(speed); }

absl::StatusOr<std::unique_ptr<EventSource>> CreateEventSource(const EventSourceSpec& spec) {
  if (const auto* raw = std::get_if<RawSourceOptions>(&spec.events)) {
    return RawEventSource::Create(*raw);
  }
  if (const auto* live = std::get_if<MetavisionSourceOptions>(&spec.events)) {
    return MetavisionEventSource::Create(*live);
  }
  return SimulatedEventSource::Create(std::get<SimulatedEventSourceOptions>(spec.events));
}

struct FrameMaker {
  using Result = absl::StatusOr<std::unique_ptr<FrameSource>>;
  Result operator()(const ImagesSourceOptions& options) const {
    return ImagesFrameSource::Create(options);
  }
  Result operator()(const VideoSourceOptions& options) const {
    return VideoFrameSource::Create(options);
  }
  Result operator()(const SimulatedFrameSourceOptions& options) const {
    return SimulatedFrameSource::Create(options);
  }
  Result operator()(const AravisSourceOptions& options) const {
    return AravisFrameSource::Create(options);
  }
};

struct Maker {
  using Result = absl::StatusOr<std::unique_ptr<ObservationSource>>;
  Result operator()(const CsvSourceOptions& options) const {
    return CsvObservationSource::Create(options);
  }
  Result operator()(const SimulatedSourceOptions& options) const {
    return SimulatedObservationSource::Create(options);
  }
  Result operator()(const FrameSourceSpec& spec) const {
    RIGCAL_ASSIGN_OR_RETURN(auto frames, CreateFrameSource(spec));
    return DetectingObservationSource::Create(std::move(frames), spec.detecting);
  }
  Result operator()(const EventSourceSpec& spec) const {
    RIGCAL_ASSIGN_OR_RETURN(auto events, CreateEventSource(spec));
    return EventObservationSource::Create(std::move(events), spec.detector);
  }
};

}  // namespace

absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text) { return Parse(text, {}); }

absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text,
                                           const std::vector<SourceOption>& options) {
  return Parse(text, options);
}

absl::StatusOr<SourceSpec> ParseSourceSpec(const CameraConfig& camera) {
  const std::string text =
      camera.name.empty() ? camera.source : absl::StrCat(camera.name, "=", camera.source);
  std::vector<SourceOption> options = camera.options;
  const auto add = [&](std::string_view key, std::string value) {
    options.push_back({.key = std::string(key), .value = std::move(value), .where = camera.where});
  };
  if (camera.speed) add("speed", SpeedText(*camera.speed));
  if (camera.sigma_px) add("sigma", ShortestText(*camera.sigma_px));
  if (!camera.calibration.empty()) add("calibration", camera.calibration);
  absl::StatusOr<SourceSpec> spec = Parse(text, options);
  if (spec.ok()) return spec;
  return absl::InvalidArgumentError(
      absl::StrCat(camera.where, ": ", std::string(spec.status().message())));
}

const std::string& CameraNameOf(const FrameSourceSpec& spec) {
  return std::visit([](const auto& options) -> const std::string& { return options.camera; },
                    spec.frames);
}

const std::string& CameraNameOf(const SourceSpec& spec) {
  if (const auto* pictures = std::get_if<FrameSourceSpec>(&spec)) return CameraNameOf(*pictures);
  if (const auto* events = std::get_if<EventSourceSpec>(&spec))
    return std::visit([](const auto& options) -> const std::string& { return options.camera; },
                      events->events);
  if (const auto* csv = std::get_if<CsvSourceOptions>(&spec)) return csv->camera;
  return std::get<SimulatedSourceOptions>(spec).camera;
}

absl::StatusOr<std::unique_ptr<FrameSource>> CreateFrameSource(const FrameSourceSpec& spec) {
  return std::visit(FrameMaker{}, spec.frames);
}

absl::StatusOr<std::unique_ptr<ObservationSource>> CreateSource(const SourceSpec& spec) {
  return std::visit(Maker{}, spec);
}

}  // namespace rigcal::agent
