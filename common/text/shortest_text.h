// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace rigcal {

// The shortest text that reads back as the same double: "0.1", "1e-07", "inf", "nan".
std::string ShortestText(double value);

}  // namespace rigcal
