// SPDX-License-Identifier: Apache-2.0
#include "server/solve/running/instant_thinning.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "common/statistics/robust_statistics.h"

namespace rigcal::server {

InstantThinning::InstantThinning(const InstantList& list, int max_views)
    : instant_count_(static_cast<int>(list.instants.size())) {
  if (list.instants.empty()) return;
  origin_ns_ = list.instants.front().rig_time_ns;
  size_t views = 0;
  for (const Instant& instant : list.instants) {
    origin_ns_ = std::min(origin_ns_, instant.rig_time_ns);
    views += instant.members.size();
  }
  const auto most = static_cast<size_t>(std::max(1, max_views));
  stride_ = std::max<int64_t>(1, static_cast<int64_t>((views + most - 1) / most));
  std::vector<int64_t> steps;
  for (size_t i = 1; i < list.instants.size(); ++i) {
    steps.push_back(list.instants[i].rig_time_ns - list.instants[i - 1].rig_time_ns);
  }
  slot_ns_ = steps.empty() ? 1 : std::max<int64_t>(1, UpperMedian(&steps));
}

bool InstantThinning::IsChosen(int64_t rig_time_ns, int64_t one_of) const {
  const int64_t stride = one_of * stride_;
  return stride == 1 || ((rig_time_ns - origin_ns_) / slot_ns_) % stride == 0;
}

}  // namespace rigcal::server
