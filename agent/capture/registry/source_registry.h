// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "agent/capture/source_kind.h"
#include "common/config/agent_config.h"

namespace rigcal::agent {

// Every kind of source, in the order of help and documentation.
std::span<const SourceKind* const> SourceKinds();

// True for `[NAME=]KIND:...`.
bool IsSourceText(std::string_view text);

// Reads a SPEC as typed behind --source: [NAME=]KIND:[SUBJECT][;OPTION=VALUE]..., where `overrides`
// replace options of the text. Neither names nor values can hold a ';'. INVALID_ARGUMENT with every
// fault and an example.
absl::StatusOr<std::unique_ptr<SourceSpec>> ParseSourceSpec(
    std::string_view text, const std::vector<OptionText>& overrides = {});

// From a [[camera]] of a configuration file, whose keys override its source. Paths are relative to
// the file's folder. INVALID_ARGUMENT begins with file and line.
absl::StatusOr<std::unique_ptr<SourceSpec>> ParseSourceSpec(const CameraConfig& camera);

}  // namespace rigcal::agent
