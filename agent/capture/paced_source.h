// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "agent/capture/pacer.h"
#include "common/camera/camera_description.h"

namespace rigcal::agent {

// What sources with a pace of their own share. `Base` is the interface of a source; `Options` has a
// `speed`.
template <typename Base, typename Options>
class PacedSource : public Base {
 public:
  PacedSource(Options options, CameraDescription description)
      : options_(std::move(options)),
        description_(std::move(description)),
        pacer_(options_.speed) {}

  const CameraDescription& description() const override { return description_; }
  void Stop() override { pacer_.Stop(); }

 protected:
  const Options options_;
  CameraDescription description_;
  Pacer pacer_;
};

}  // namespace rigcal::agent
