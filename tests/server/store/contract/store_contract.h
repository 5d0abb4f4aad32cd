// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "tests/server/store/store_fixture.h"

namespace rigcal::testing {

// What every kind of store does: a fixture whose parameter is the kind. A test with it is run for
// each kind that this PC has, see RIGCAL_FOR_EVERY_STORE.
class StoreContract : public StoreFixture, public ::testing::WithParamInterface<std::string> {
 protected:
  void Open() override;

 private:
  std::string location_;
};

// A place for a new empty store of this kind, for OpenStoreAt; `folder` is for one on this disk.
std::string NewLocation(const std::string& kind, const std::filesystem::path& folder);
// It may lose data when the power fails; no test here does that.
absl::StatusOr<std::unique_ptr<server::Store>> OpenStoreAt(const std::string& location);

// "sqlite", and "postgresql" where its server is installed (postgresql_installed_test tells).
std::vector<std::string> StoreKinds();

inline std::string NameOfKind(const ::testing::TestParamInfo<std::string>& kind) {
  return kind.param;
}

// Runs the TEST_P of a suite for every kind of store.
#define RIGCAL_FOR_EVERY_STORE(Suite)                                                           \
  INSTANTIATE_TEST_SUITE_P(Stores, Suite, ::testing::ValuesIn(::rigcal::testing::StoreKinds()), \
                           ::rigcal::testing::NameOfKind)

}  // namespace rigcal::testing
