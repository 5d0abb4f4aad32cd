// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/calibration/activation.h"
#include "server/store/store.h"

namespace rigcal::server {

// A rig and its active calibration.
struct RigState {
  RigSummary summary;
  Activation activation;             // `calibration_id` empty: none is active
  std::vector<std::string> cameras;  // of the active calibration
};

// Who makes a calibration active, and why.
struct ActivationRequest {
  std::string operator_name;  // empty: the server's own PC
  std::string reason;
  bool force = false;  // also one that is bad or has other cameras
};

// Which calibration of each rig is active. Everything is in the store. Thread-safe.
class RigBook {
 public:
  // `store` must outlive it. `utc_now_ns` unset: the system's clock.
  explicit RigBook(Store* store, std::function<int64_t()> utc_now_ns = {});

  absl::StatusOr<std::vector<RigState>> ListRigs() const;
  absl::StatusOr<RigState> GetRig(std::string_view name) const;
  // Newest first. NOT_FOUND: no such rig.
  absl::StatusOr<std::vector<Activation>> History(std::string_view rig) const;

  // Errors as in rigcal/v1/rig_service.proto.
  absl::StatusOr<Activation> Activate(std::string_view calibration_id,
                                      const ActivationRequest& request);
  absl::StatusOr<Activation> Rollback(std::string_view rig, const ActivationRequest& request);

 private:
  absl::StatusOr<RigState> StateOf(const RigSummary& summary) const;
  absl::StatusOr<Activation> Active(std::string_view rig) const;
  absl::StatusOr<Activation> Add(const Calibration& calibration, const Activation& before,
                                 const ActivationRequest& request, bool rollback);

  Store* const store_;
  const std::function<int64_t()> utc_now_ns_;
};

}  // namespace rigcal::server
