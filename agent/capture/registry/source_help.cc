// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/registry/source_help.h"

#include <algorithm>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_replace.h"
#include "agent/capture/registry/source_registry.h"
#include "common/options/nearest_name.h"

namespace rigcal::agent {
namespace {

// "csv:PATH", "sim:camera=INDEX;pixels=1"
std::string BeginningOf(const SourceKind& kind) {
  std::string text = absl::StrCat(std::string(kind.name), ":", std::string(kind.subject));
  if (!kind.required.empty()) absl::StrAppend(&text, std::string(kind.required), "=INDEX");
  if (!kind.selector.empty()) absl::StrAppend(&text, ";", std::string(kind.selector), "=1");
  return text;
}

std::vector<OptionHelp> OptionsOf(const SourceKind& kind) {
  const std::unique_ptr<SourceSpec> spec = kind.make();
  OptionTable table;
  spec->AddTo(&table);
  return table.Help();
}

std::string InMarkdown(const std::string& text) {
  return absl::StrReplaceAll(text, {{"|", "\\|"}});
}

}  // namespace

std::string SourceSummaries() {
  std::string text;
  for (const SourceKind* kind : SourceKinds()) {
    absl::StrAppend(&text, absl::StrFormat("  %-28s %s\n", BeginningOf(*kind), kind->summary));
  }
  return text;
}

absl::StatusOr<std::string> SourceOptionsHelp(std::string_view kind_name) {
  std::string text;
  std::vector<std::string> names;
  for (const SourceKind* kind : SourceKinds()) {
    names.emplace_back(kind->name);
    if (kind->name != kind_name) continue;
    absl::StrAppend(&text, text.empty() ? "" : "\n", BeginningOf(*kind), "  ",
                    std::string(kind->summary), "\n  example: ", std::string(kind->example), "\n");
    for (const OptionHelp& option : OptionsOf(*kind)) {
      const std::string standard =
          option.default_value.empty() ? "" : absl::StrCat(" [", option.default_value, "]");
      absl::StrAppend(&text, absl::StrFormat("  %-18s %-22s %s%s\n", option.name, option.values,
                                             option.meaning, standard));
    }
  }
  if (!text.empty()) return text;
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return absl::InvalidArgumentError(UnknownName("source", kind_name, names));
}

std::string SourcesMarkdown() {
  std::string text =
      "# Camera sources\n\n"
      "This page is written by `rigcal-agent sources --markdown`; do not edit it.\n\n"
      "A source is `[NAME=]KIND:[SUBJECT][;OPTION=VALUE]...`: behind `--source`, or as `source` of "
      "a\n`[[camera]]` in the agent's configuration file, whose tables `[camera.settings]` and\n"
      "`[camera.detector]` hold the same options. NAME is the camera's name within the rig; "
      "without it\nthe camera is named after the subject.\n\n"
      "| source | what it is |\n|---|---|\n";
  for (const SourceKind* kind : SourceKinds()) {
    absl::StrAppend(&text, "| `", BeginningOf(*kind), "` | ", std::string(kind->summary), " |\n");
  }
  for (const SourceKind* kind : SourceKinds()) {
    absl::StrAppend(&text, "\n## ", BeginningOf(*kind), "\n\nExample: `",
                    std::string(kind->example),
                    "`\n\n| option | values | default | meaning |\n|---|---|---|---|\n");
    for (const OptionHelp& option : OptionsOf(*kind)) {
      absl::StrAppend(&text, "| `", option.name, "` | ", InMarkdown(option.values), " | ",
                      option.default_value, " | ", InMarkdown(option.meaning), " |\n");
    }
  }
  return text;
}

}  // namespace rigcal::agent
