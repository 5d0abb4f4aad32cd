// SPDX-License-Identifier: Apache-2.0
#include "server/store/factory/open_store.h"

#include "absl/strings/str_cat.h"
#include "server/store/sqlite/sqlite_store.h"

namespace rigcal::server {
absl::StatusOr<std::unique_ptr<Store>> OpenStore(const std::string& location,
                                                 const StoreOptions& options) {
  const size_t colon = location.find(':');
  std::string kind = "sqlite";
  std::string place = location;
  // "./a:b" is a path, "a:b" is not.
  if (colon != std::string::npos && colon < location.find('/')) {
    kind = location.substr(0, colon);
    place = location.substr(colon + 1);
  }
  if (kind == "sqlite") {
    return SqliteStore::Open({.data_directory = place, .min_free_bytes = options.min_free_bytes});
  }
  return absl::InvalidArgumentError(absl::StrCat("'", location, "': unknown kind of store '", kind,
                                                 "'; known: sqlite (write ./", location,
                                                 " for a folder of that name)"));
}

}  // namespace rigcal::server
