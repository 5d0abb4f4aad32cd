// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/source_spec.h"

#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/camera/camera_id.h"
#include "common/status/status_macros.h"

namespace rigcal::agent {
namespace {

constexpr std::string_view kCsvExample = "left=csv:rig/left.csv;speed=max;sigma=0.5";
constexpr std::string_view kSimExample = "sim:camera=0;seed=1;cameras=6;speed=max";

absl::Status Fault(std::string_view text, const std::string& what, std::string_view example) {
  return absl::InvalidArgumentError(absl::StrCat("source \"", std::string(text), "\": ", what,
                                                 "; example: ", std::string(example)));
}

struct Part {
  std::string key;
  std::string value;
};

// Splits "key=value" parts; each key at most once.
absl::StatusOr<std::vector<Part>> SplitParts(const std::vector<std::string>& texts) {
  std::vector<Part> parts;
  for (const std::string& text : texts) {
    const std::pair<std::string, std::string> pair = absl::StrSplit(text, absl::MaxSplits('=', 1));
    if (pair.first.empty() || pair.second.empty()) {
      return absl::InvalidArgumentError(absl::StrCat("part \"", text, "\" is not KEY=VALUE"));
    }
    for (const Part& earlier : parts) {
      if (earlier.key == pair.first) {
        return absl::InvalidArgumentError(absl::StrCat(pair.first, " is given twice"));
      }
    }
    parts.push_back({pair.first, pair.second});
  }
  return parts;
}

// Paths reach protobuf strings and logs, which must be UTF-8. Overlong forms and surrogates pass:
// protobuf checks no more than that a lead byte has its continuation bytes.
bool IsUtf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const auto byte = static_cast<unsigned char>(text[i++]);
    const int more = byte < 0x80                   ? 0
                     : byte >= 0xC2 && byte < 0xE0 ? 1
                     : byte >= 0xE0 && byte < 0xF0 ? 2
                     : byte >= 0xF0 && byte < 0xF5 ? 3
                                                   : -1;
    if (more < 0) return false;
    for (int k = 0; k < more; ++k, ++i) {
      if (i >= text.size() || (static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return false;
    }
  }
  return true;
}

absl::StatusOr<SourceSpec> ParseCsv(std::string_view name, std::string_view body) {
  std::vector<std::string> texts = absl::StrSplit(std::string(body), ';');
  CsvSourceOptions options;
  options.path = texts.front();
  texts.erase(texts.begin());
  if (options.path.empty()) return absl::InvalidArgumentError("there is no path behind csv:");
  if (!IsUtf8(options.path)) return absl::InvalidArgumentError("the path is not UTF-8; rename it");
  const std::filesystem::path path(options.path);
  options.camera = name.empty() ? path.stem().string() : std::string(name);
  options.calibration_path = std::filesystem::path(path).replace_extension(".yaml").string();
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Part> parts, SplitParts(texts));
  for (const Part& part : parts) {
    if (part.key == "speed") {
      RIGCAL_ASSIGN_OR_RETURN(options.speed, ParseSpeed(part.value));
    } else if (part.key == "sigma") {
      if (!absl::SimpleAtod(part.value, &options.sigma_px) || !std::isfinite(options.sigma_px) ||
          options.sigma_px <= 0) {
        return absl::InvalidArgumentError(
            absl::StrCat("sigma=", part.value, " is not a number of pixels above 0"));
      }
    } else if (part.key == "calibration") {
      options.calibration_path = part.value;
    } else {
      return absl::InvalidArgumentError(
          absl::StrCat("part \"", part.key, "\" is not known (known: speed, sigma, calibration)"));
    }
  }
  return options;
}

absl::StatusOr<SourceSpec> ParseSim(std::string_view name, std::string_view body) {
  RIGCAL_ASSIGN_OR_RETURN(const std::vector<Part> parts,
                          SplitParts(absl::StrSplit(std::string(body), ';', absl::SkipEmpty())));
  SimulatedSourceOptions options;
  std::vector<std::string> world;
  bool has_index = false;
  for (const Part& part : parts) {
    if (part.key == "camera") {
      has_index = absl::SimpleAtoi(part.value, &options.camera_index) && options.camera_index >= 0;
      if (!has_index) {
        return absl::InvalidArgumentError(
            absl::StrCat("camera=", part.value, " is not a camera's index (0, 1, ...)"));
      }
    } else if (part.key == "speed") {
      RIGCAL_ASSIGN_OR_RETURN(options.speed, ParseSpeed(part.value));
    } else {
      world.push_back(absl::StrCat(part.key, "=", part.value));
    }
  }
  if (!has_index) return absl::InvalidArgumentError("there is no camera=INDEX");
  options.camera = name.empty() ? absl::StrCat("sim_", options.camera_index) : std::string(name);
  RIGCAL_ASSIGN_OR_RETURN(options.simulation, ParseSimulationOptions(absl::StrJoin(world, ";")));
  return options;
}

bool BeginsWithKind(std::string_view text) {
  return text.starts_with("csv:") || text.starts_with("sim:");
}

}  // namespace

absl::StatusOr<SourceSpec> ParseSourceSpec(std::string_view text) {
  std::string_view name;
  std::string_view rest = text;
  if (const size_t equals = text.find('='); !BeginsWithKind(text) && equals != text.npos) {
    name = text.substr(0, equals);
    rest = text.substr(equals + 1);
    if (name.empty()) return Fault(text, "there is no name before '='", kCsvExample);
  }
  if (!BeginsWithKind(rest)) {
    return Fault(text,
                 absl::StrCat("\"", std::string(rest), "\" begins with neither csv: nor sim:"),
                 kCsvExample);
  }
  const bool is_csv = rest.starts_with("csv:");
  const std::string_view body = rest.substr(4);
  const std::string_view example = is_csv ? kCsvExample : kSimExample;
  absl::StatusOr<SourceSpec> spec = is_csv ? ParseCsv(name, body) : ParseSim(name, body);
  if (!spec.ok()) return Fault(text, std::string(spec.status().message()), example);
  if (const absl::Status status = ValidateName("camera name", CameraNameOf(*spec)); !status.ok()) {
    return Fault(text, std::string(status.message()), example);
  }
  return spec;
}

absl::StatusOr<SourceSpec> ParseSourceSpec(const CameraConfig& camera) {
  const std::string text =
      camera.name.empty() ? camera.source : absl::StrCat(camera.name, "=", camera.source);
  absl::StatusOr<SourceSpec> spec = ParseSourceSpec(text);
  if (!spec.ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(camera.where, ": ", std::string(spec.status().message())));
  }
  const double speed = camera.speed.value_or(0);
  if (auto* csv = std::get_if<CsvSourceOptions>(&*spec)) {
    if (camera.speed) csv->speed = speed;
    if (camera.sigma_px) csv->sigma_px = *camera.sigma_px;
    if (!camera.calibration.empty()) csv->calibration_path = camera.calibration;
    return spec;
  }
  if (camera.speed) std::get<SimulatedSourceOptions>(*spec).speed = speed;
  if (camera.sigma_px || !camera.calibration.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(camera.where,
                     ": a simulated camera has neither sigma nor calibration; its noise is the "
                     "option noise of its source"));
  }
  return spec;
}

const std::string& CameraNameOf(const SourceSpec& spec) {
  return std::visit([](const auto& options) -> const std::string& { return options.camera; }, spec);
}

absl::StatusOr<std::unique_ptr<ObservationSource>> CreateSource(const SourceSpec& spec) {
  if (const auto* csv = std::get_if<CsvSourceOptions>(&spec)) {
    return CsvObservationSource::Create(*csv);
  }
  return SimulatedObservationSource::Create(std::get<SimulatedSourceOptions>(spec));
}

}  // namespace rigcal::agent
