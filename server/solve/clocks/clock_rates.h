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

// Finds clocks that run differently from the others of their session. They are compared with the
// median clock (of the rates, least sum of distances; of equal ones the first whose rate is 0, then
// the first): most clocks run alike, and the one that the others were measured against may be the
// one that does not. A clock that runs alike is better without a rate: it is one more unknown, and
// a camera that saw little would be given any. But where a third of a session's rates, and two
// at least, stand out, every clock is an oscillator of its own, and holding the rest at rate 0
// would put the median clock's rate into their offsets: all that were estimated are kept.
//
// `sigma_between(k, l)`: one sigma of rate k minus rate l. Where it is not finite and positive, no
// rate is kept. A clock that stands out does so by 5 sigmas, and by 0.4 ms over its span.
std::vector<bool> FindOwnRates(const std::vector<RateEstimate>& clocks,
                               const std::function<double(size_t, size_t)>& sigma_between);

}  // namespace rigcal::server
