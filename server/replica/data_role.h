// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace rigcal::server {

// What a data folder is for.
enum class RoleOfData {
  kServer,      // an ordinary server's
  kStandby,     // it follows a primary
  kPromoted,    // it followed one and has taken over
  kSuperseded,  // another server has taken over from it
};

struct DataRole {
  RoleOfData role = RoleOfData::kServer;
  std::string standby_id = {};     // of a standby, or of one that has taken over
  std::string primary = {};        // that it follows, or followed
  bool complete = false;           // it had everything of the primary once
  uint64_t generation = 0;         // kSuperseded: of the server that has taken over
  std::string superseded_by = {};  // who said so, or that server's address
};

// The file standby.json of a data folder; none: kServer. DATA_LOSS: it is damaged.
absl::StatusOr<DataRole> ReadDataRole(const std::filesystem::path& data_dir);
absl::Status WriteDataRole(const std::filesystem::path& data_dir, const DataRole& role);

// Why a server on a folder with this role must not serve, and what to do. Empty for those that may.
std::string WhyNotToServe(const DataRole& role);

}  // namespace rigcal::server
