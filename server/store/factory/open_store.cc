// SPDX-License-Identifier: Apache-2.0
#include "server/store/factory/open_store.h"

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "server/store/sqlite/sqlite_store.h"

namespace rigcal::server {
namespace {

using StorePointer = absl::StatusOr<std::unique_ptr<Store>>;

struct StoreKind {
  const char* name;
  StorePointer (*open)(const std::string& place);
};

// The first one is the default.
constexpr StoreKind kStoreKinds[] = {{"sqlite", [](const std::string& folder) -> StorePointer {
                                        return SqliteStore::Open({.data_directory = folder});
                                      }}};

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> OpenStore(const std::string& location) {
  const size_t colon = location.find(':');
  // "./a:b" is a path, "a:b" is not.
  if (colon == std::string::npos || location.find('/') < colon) {
    return kStoreKinds[0].open(location);
  }
  const std::string name = location.substr(0, colon);
  for (const StoreKind& kind : kStoreKinds) {
    if (name == kind.name) return kind.open(location.substr(colon + 1));
  }
  return absl::InvalidArgumentError(absl::StrCat(
      "'", location, "': unknown kind of store '", name, "'; known: ",
      absl::StrJoin(kStoreKinds, ", ",
                    [](std::string* out, const StoreKind& kind) { out->append(kind.name); }),
      " (write ./", location, " for a folder of that name)"));
}

}  // namespace rigcal::server
