// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace rigcal::agent {

inline double Squared(double x) { return x * x; }

}  // namespace rigcal::agent
