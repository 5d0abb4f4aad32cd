// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "server/access/trusted_ca.h"

namespace rigcal::server {

// The server's certificate, its key and its CA: files server.crt, server.key and ca.crt of a
// folder. They count only once they have been checked to belong together; then copies of them are
// put where the transport watches them (active()), all three at once. Thread-safe.
class CheckedIdentity {
 public:
  // FAILED_PRECONDITION names the file and says what is wrong.
  static absl::StatusOr<std::unique_ptr<CheckedIdentity>> Load(
      std::filesystem::path folder, std::function<absl::Time()> now = absl::Now);

  // Looks whether the files have changed, and takes them when they are good. What is wrong with
  // them is logged once, and the old ones stay. Also warns when the certificate ends soon. Call it
  // every second or so.
  void Refresh();

  // The folder with the checked copies.
  std::filesystem::path active() const { return folder_ / ".active" / "current"; }
  std::shared_ptr<const TrustedCa> ca() const;
  absl::Time Now() const { return now_(); }

 private:
  CheckedIdentity(std::filesystem::path folder, std::function<absl::Time()> now)
      : folder_(std::move(folder)), now_(std::move(now)) {}

  absl::Status Take();
  absl::Status Publish(const std::array<std::string, 3>& texts);
  std::string Version() const;  // of the files: it changes whenever one of them does
  void WarnOfEnd();

  const std::filesystem::path folder_;
  const std::function<absl::Time()> now_;
  mutable std::mutex mutex_;
  std::string version_;
  std::string faulty_version_;
  bool fault_logged_ = false;
  bool end_logged_ = false;
  absl::Time end_;
  uint64_t published_ = 0;
  std::shared_ptr<const TrustedCa> ca_;
};

}  // namespace rigcal::server
