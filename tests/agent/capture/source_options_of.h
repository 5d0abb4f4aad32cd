// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "agent/capture/source_kind.h"

namespace rigcal::agent {

// The options that a spec was read into. Throws std::bad_cast if it is of another kind.
template <typename Options>
const Options& OptionsOf(const SourceSpec& spec) {
  return dynamic_cast<const HasOptions<Options>&>(spec).options;
}

}  // namespace rigcal::agent
