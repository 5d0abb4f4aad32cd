// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "server/associate/instants.h"

namespace rigcal::server {

// Chooses instants evenly in time, so that about a given number of views is solved: every so many
// slots of time, each as wide as the median step between instants. Chooses all until it is told of
// instants.
class InstantThinning {
 public:
  InstantThinning() = default;
  // A view is an instant in one camera.
  InstantThinning(const InstantList& list, int max_views);

  // How many instants the list has, chosen or not.
  int instant_count() const { return instant_count_; }
  // Rig time of the earliest one.
  int64_t origin_ns() const { return origin_ns_; }
  // Of those that are chosen, one of `one_of`.
  bool IsChosen(int64_t rig_time_ns, int64_t one_of = 1) const;

 private:
  int instant_count_ = 0;
  int64_t stride_ = 1, origin_ns_ = 0, slot_ns_ = 1;
};

}  // namespace rigcal::server
