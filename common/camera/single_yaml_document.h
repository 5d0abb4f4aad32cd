// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "absl/status/statusor.h"

namespace rigcal {

// INVALID_ARGUMENT: "PATH, line N: WHY".
absl::Status YamlLineError(const std::string& path, int line, const std::string& why);

// The fields of an OpenCV YAML text as one document, on the same lines as in `text`. OpenCV's
// parser overflows the stack on deep nesting, and turns for ever in some texts that hold several
// documents or stray signs between fields (4.6), so that only texts of the form it writes itself
// are let through; comments and the marks `---` and `...` are taken out. INVALID_ARGUMENT names
// `path` and the line.
absl::StatusOr<std::string> SingleDocument(const std::string& path, const std::string& text);

}  // namespace rigcal
