// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/store/store.h"

namespace rigcal::server {

struct StoreOptions {
  // Observations are refused while the disk has less room than this.
  uint64_t min_free_bytes = uint64_t{256} << 20;
};

// Opens the store at `location`, KIND:PLACE, or a folder's path alone for the default kind. Kinds:
//   sqlite:FOLDER  one SQLite database in the folder, created where it is missing (the default)
// INVALID_ARGUMENT: an unknown kind; the known ones are named. Else as the Open of that kind.
//
// Another kind of store is a folder beside this one and a line in open_store.cc.
absl::StatusOr<std::unique_ptr<Store>> OpenStore(const std::string& location,
                                                 const StoreOptions& options = {});

}  // namespace rigcal::server
