// SPDX-License-Identifier: Apache-2.0
#include "tests/server/store/contract/store_contract.h"

#include "server/store/factory/open_store.h"
#include "tests/testing/postgres_cluster.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing {

std::vector<std::string> StoreKinds() {
  std::vector<std::string> kinds = {"sqlite"};
  if (PostgresCluster::Installed()) kinds.emplace_back("postgresql");
  return kinds;
}

std::string NewLocation(const std::string& kind, const std::filesystem::path& folder) {
  return kind == "postgresql" ? PostgresCluster::Shared().NewUrl() : folder.string();
}

absl::StatusOr<std::unique_ptr<server::Store>> OpenStoreAt(const std::string& location) {
  return server::OpenStore(location, {.min_free_bytes = 0, .unsafe = true});
}

void StoreContract::Open() {
  if (location_.empty()) location_ = NewLocation(GetParam(), folder());
  ASSERT_OK_AND_ASSIGN(store_, OpenStoreAt(location_));
}

}  // namespace rigcal::testing
