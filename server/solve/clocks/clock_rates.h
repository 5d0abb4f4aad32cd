// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

namespace rigcal::server {

// A clock's rate where every clock but one of each session was given a rate to estimate.
struct RateEstimate {
  std::string session_id;
  double rate = 0;    // s/s; 0 of the clock that the others were measured against
  double span_s = 0;  // from its first to its last observation
  bool estimated = true;
};

struct RateTestOptions {
  double sigmas = 5;
  // Over the clock's span; less moves no marker by a noticeable part.
  double min_drift_s = 4e-4;
};

// Which clocks run differently from the others of their session. Clocks are held against the one in
// the middle (of the rates, least sum of distances; of equal ones the first whose rate is 0, then
// the first): most clocks run alike, and the one that the others were measured against may be the
// one that does not. A clock that runs alike is better without a rate: it is one more unknown, and
// a camera that saw little would be given any. But where a third of a session's rates, and two
// at least, stand out, every clock is an oscillator of its own, and to hold the rest at no rate
// would put the middle clock's into their offsets: all that were estimated are kept.
//
// `sigma_between(k, l)`: one sigma of rate k minus rate l. One that is not finite and positive says
// nothing, and makes no rate.
std::vector<bool> FindOwnRates(const std::vector<RateEstimate>& clocks,
                               const std::function<double(size_t, size_t)>& sigma_between,
                               const RateTestOptions& options);

}  // namespace rigcal::server
