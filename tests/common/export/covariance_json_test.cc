// SPDX-License-Identifier: Apache-2.0
#include "common/export/covariance_json.h"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

namespace rigcal {
namespace {

TEST(WithCameraCovariance, AddsAFieldThatReadsBack) {
  const std::vector<double> packed = {1e-6, -2.5e-7, 1.0 / 3e6};
  const auto json = nlohmann::json::parse(WithCameraCovariance("{\n \"id\": \"c-1\"\n}\n", packed));
  EXPECT_EQ(json.at("id"), "c-1");
  ASSERT_EQ(json.at("camera_covariance").size(), 3u);
  EXPECT_NEAR(json.at("camera_covariance")[2].get<double>(), packed[2], 1e-13 * packed[2]);
  EXPECT_EQ(nlohmann::json::parse(WithCameraCovariance("{}", {2})).at("camera_covariance")[0], 2);
}

TEST(WithCameraCovariance, LeavesTheTextWhereThereIsNothingToAdd) {
  EXPECT_EQ(WithCameraCovariance("{}", {}), "{}");
  EXPECT_EQ(WithCameraCovariance("{}", {std::numeric_limits<double>::quiet_NaN()}), "{}");
}

}  // namespace
}  // namespace rigcal
