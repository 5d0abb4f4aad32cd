// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

namespace rigcal {

// Whether a file that begins so is UTF-16, as "Unicode text" of a spreadsheet is: by its byte order
// mark, or by a zero in every second byte.
bool BeginsLikeUtf16(std::string_view begin);

}  // namespace rigcal
