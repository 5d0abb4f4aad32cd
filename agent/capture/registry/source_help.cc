// SPDX-License-Identifier: Apache-2.0
#include "agent/capture/registry/source_help.h"

#include <algorithm>
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "agent/capture/event_source_spec.h"
#include "agent/capture/frame_source_spec.h"
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

// A heading of the page, and the rows of the table below it.
struct Section {
  std::string heading;
  std::vector<std::string> rows;
};

std::vector<std::string> RowsOf(const std::vector<OptionHelp>& options) {
  std::vector<std::string> rows;
  for (const OptionHelp& option : options) {
    rows.push_back(absl::StrCat("| `", option.name, "` | ", InMarkdown(option.values), " | ",
                                option.default_value, " | ", InMarkdown(option.meaning), " |\n"));
  }
  return rows;
}

// The detector that every `Spec` has.
template <typename Spec>
Section DetectorSection(const std::string& heading) {
  for (const SourceKind* kind : SourceKinds()) {
    const std::unique_ptr<SourceSpec> spec = kind->make();
    auto* const detecting = dynamic_cast<Spec*>(spec.get());
    if (detecting == nullptr) continue;
    OptionTable table;
    detecting->AddDetector(&table);
    return {heading, RowsOf(table.Help())};
  }
  return {heading, {}};
}

// Empty without rows.
std::string TableOf(const Section& section) {
  if (section.rows.empty()) return "";
  return absl::StrCat("\n| option | values | default | meaning |\n|---|---|---|---|\n",
                      absl::StrJoin(section.rows, ""));
}

// "[csv:PATH](#csvpath)"
std::string LinkTo(const std::string& heading) {
  std::string anchor;
  for (const char c : heading) {
    const auto letter = static_cast<unsigned char>(c);
    if (absl::ascii_isalnum(letter)) anchor += static_cast<char>(absl::ascii_tolower(letter));
    if (c == ' ') anchor += '-';
  }
  return absl::StrCat("[", heading, "](#", anchor, ")");
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
      "A source is `[NAME=]KIND:[SUBJECT][;OPTION=VALUE]...`, given with `--source` or as `source` "
      "of a\n`[[camera]]` in the agent's configuration file, whose tables `[camera.settings]` and\n"
      "`[camera.detector]` hold the same options. NAME is the camera's name within the rig; "
      "without it\nthe camera is named after the subject.\n\n"
      "Options that several sources share are listed once; the other sources refer to that table.\n"
      "`rigcal-agent sources KIND` lists all options of a kind.\n\n"
      "| source | what it is |\n|---|---|\n";
  for (const SourceKind* kind : SourceKinds()) {
    absl::StrAppend(&text, "| `", BeginningOf(*kind), "` | ", std::string(kind->summary), " |\n");
  }
  const Section detectors[] = {DetectorSection<FrameSourceSpec>("Frame detector"),
                               DetectorSection<EventSourceSpec>("Event detector")};
  std::vector<Section> sections;
  for (const SourceKind* kind : SourceKinds()) {
    Section section{BeginningOf(*kind), RowsOf(OptionsOf(*kind))};
    std::vector<std::string> links;
    const auto refer = [&section, &links](const Section& other) {
      const auto found = std::ranges::search(section.rows, other.rows);
      if (found.empty()) return;
      section.rows.erase(found.begin(), found.end());
      links.push_back(LinkTo(other.heading));
    };
    for (const Section& other : sections) refer(other);
    for (const Section& other : detectors) refer(other);

    absl::StrAppend(&text, "\n## ", section.heading, "\n\nExample: `", std::string(kind->example),
                    "`\n", TableOf(section));
    if (!links.empty()) {
      absl::StrAppend(&text, section.rows.empty() ? "\nIts options are" : "\nFurther options are",
                      links.size() == 1 ? " in the table under " : " in the tables under\n",
                      absl::StrJoin(links, " and "), ".\n");
    }
    sections.push_back(std::move(section));
  }
  for (const Section& section : detectors) {
    absl::StrAppend(&text, "\n## ", section.heading, "\n", TableOf(section));
  }
  return text;
}

}  // namespace rigcal::agent
