// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/registry/source_registry.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "common/options/nearest_name.h"
#include "common/status/status_macros.h"
#include "common/status/validate_name.h"
#include "common/text/utf8.h"

namespace rigcal::agent {

// Each is defined beside its source. A new one is declared and listed here.
extern const SourceKind kCsvSource, kImagesSource, kVideoSource, kAravisSource, kRawSource,
    kMetavisionSource, kSimulatedMarkersSource, kSimulatedFramesSource, kSimulatedEventsSource;

std::span<const SourceKind* const> SourceKinds() {
  static constexpr const SourceKind* kKinds[] = {&kCsvSource,
                                                 &kImagesSource,
                                                 &kVideoSource,
                                                 &kAravisSource,
                                                 &kRawSource,
                                                 &kMetavisionSource,
                                                 &kSimulatedMarkersSource,
                                                 &kSimulatedFramesSource,
                                                 &kSimulatedEventsSource};
  return kKinds;
}

namespace {

// "csv" of "csv:left.csv;speed=max"; empty: no kind that there is.
std::string_view KindNameOf(std::string_view text) {
  const std::string_view name = text.substr(0, std::min(text.find(':'), text.size()));
  const auto is_it = [&](const SourceKind* kind) { return kind->name == name; };
  return name.size() < text.size() && std::ranges::any_of(SourceKinds(), is_it)
             ? name
             : std::string_view();
}

// "left" and "csv:left.csv" of "left=csv:left.csv".
std::pair<std::string_view, std::string_view> SplitName(std::string_view text) {
  const size_t equals = text.find('=');
  if (!KindNameOf(text).empty() || equals == text.npos) return {"", text};
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::string UnknownKind(std::string_view text) {
  std::vector<std::string> names;
  for (const SourceKind* kind : SourceKinds()) {
    if (kind->selector.empty()) names.emplace_back(kind->name);
  }
  const size_t colon = text.find(':');
  const std::string near =
      colon == text.npos ? "" : NearestName(std::string(text.substr(0, colon)), names);
  return absl::StrCat("\"", Shown(text), "\" begins with none of ", absl::StrJoin(names, ":, "),
                      ":", near.empty() ? "" : absl::StrCat("; did you mean \"", near, ":\"?"));
}

// The kind of this name whose selector is among the options, which loses all selectors; else the
// one without a selector.
const SourceKind* ChooseKind(std::string_view name, std::vector<OptionText>* options,
                             FaultList* faults) {
  const SourceKind* chosen = nullptr;
  for (const SourceKind* kind : SourceKinds()) {
    if (kind->name != name) continue;
    bool is_selected = kind->selector.empty();
    if (!is_selected) {
      OptionTable selector;
      selector.Add(std::string(kind->selector), &is_selected, "");
      std::erase_if(*options, [&](const OptionText& option) {
        return selector.Has(option.key) && (selector.ReadOne(option, faults), true);
      });
    }
    if (is_selected) chosen = kind;
  }
  return chosen;
}

absl::Status CheckSubject(const SourceKind& kind, const std::string& subject) {
  if (!kind.subject_is_path) return absl::OkStatus();
  if (subject.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("there is no path behind ", std::string(kind.name), ":"));
  }
  if (!IsUtf8(subject)) return absl::InvalidArgumentError("the path is not UTF-8; rename it");
  return absl::OkStatus();
}

// `options` with those of one key replaced by the last of `overrides`.
std::vector<OptionText> Overridden(std::vector<OptionText> options,
                                   const std::vector<OptionText>& overrides) {
  for (const OptionText& option : overrides) {
    std::erase_if(options, [&](const OptionText& old) { return old.key == option.key; });
    options.push_back(option);
  }
  return options;
}

// What follows "csv:". Paths of a configuration file are relative to `folder`. `kind` becomes the
// one that was meant.
absl::StatusOr<std::unique_ptr<SourceSpec>> ParseBody(const std::string& name,
                                                      const std::string& folder,
                                                      std::string_view body,
                                                      const std::vector<OptionText>& overrides,
                                                      const SourceKind** kind) {
  std::string subject;
  std::vector<std::string> parts = absl::StrSplit(std::string(body), ';');
  if ((*kind)->subject.empty()) {
    std::erase(parts, "");
  } else {
    subject = parts.front();
    parts.erase(parts.begin());
  }
  FaultList faults;
  faults.Add(CheckSubject(**kind, subject));
  const absl::StatusOr<std::vector<OptionText>> typed = SplitOptions(parts);
  faults.Add(typed.status());
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  std::vector<OptionText> options = Overridden(*typed, overrides);
  *kind = ChooseKind((*kind)->name, &options, &faults);

  const auto resolve = [&folder](std::string* path) {
    if (folder.empty()) return;
    *path = (std::filesystem::path(folder) / *path).lexically_normal().string();
  };
  if ((*kind)->subject_is_path) resolve(&subject);
  std::unique_ptr<SourceSpec> spec = (*kind)->make();
  OptionTable table;
  spec->AddTo(&table);
  for (OptionText& option : options) {
    // Typed paths are relative to where they are typed.
    if (!option.where.empty() && table.IsPath(option.key) && option.value != "none") {
      resolve(&option.value);
    }
  }
  const std::string required((*kind)->required);
  if (!required.empty() &&
      std::ranges::find(options, required, &OptionText::key) == options.end()) {
    faults.Add("the option ", required, " is missing");
  }
  table.Read(options, &faults);
  RIGCAL_RETURN_IF_ERROR(faults.Result());
  RIGCAL_RETURN_IF_ERROR(spec->Resolve(name, subject));
  RIGCAL_RETURN_IF_ERROR(ValidateName("camera name", spec->camera()));
  return spec;
}

absl::Status SourceFault(std::string_view text, std::string_view why, const SourceKind& kind) {
  return absl::InvalidArgumentError(absl::StrCat("source \"", Shown(text), "\": ", std::string(why),
                                                 "; example: ", std::string(kind.example)));
}

absl::StatusOr<std::unique_ptr<SourceSpec>> ParseIn(const std::string& folder,
                                                    std::string_view text,
                                                    const std::vector<OptionText>& overrides) {
  const auto [name, rest] = SplitName(text);
  if (name.empty() && rest.size() < text.size()) {
    return SourceFault(text, "there is no name before '='", *SourceKinds().front());
  }
  const std::string_view kind_name = KindNameOf(rest);
  if (kind_name.empty()) {
    return SourceFault(text, UnknownKind(rest), *SourceKinds().front());
  }
  const SourceKind* kind = *std::ranges::find(SourceKinds(), kind_name, &SourceKind::name);
  auto spec =
      ParseBody(std::string(name), folder, rest.substr(kind_name.size() + 1), overrides, &kind);
  if (spec.ok()) return spec;
  return SourceFault(text, std::string(spec.status().message()), *kind);
}

}  // namespace

bool IsSourceText(std::string_view text) { return !KindNameOf(SplitName(text).second).empty(); }

absl::StatusOr<std::unique_ptr<SourceSpec>> ParseSourceSpec(
    std::string_view text, const std::vector<OptionText>& overrides) {
  return ParseIn("", text, overrides);
}

absl::StatusOr<std::unique_ptr<SourceSpec>> ParseSourceSpec(const CameraConfig& camera) {
  const std::string text =
      camera.name.empty() ? camera.source : absl::StrCat(camera.name, "=", camera.source);
  auto spec = ParseIn(camera.folder, text, camera.options);
  if (spec.ok()) return spec;
  return absl::InvalidArgumentError(
      absl::StrCat(camera.where, ": ", std::string(spec.status().message())));
}

}  // namespace rigcal::agent
