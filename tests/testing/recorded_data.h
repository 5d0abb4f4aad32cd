// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <optional>

namespace rigcal::testing {

// The folder with the real recordings: RIGCAL_TEST_DATA, or ../shared/data beside the project. None
// if there is no such folder.
std::optional<std::filesystem::path> RecordedDataDirectory();
bool RunsInCi();  // CI=true

}  // namespace rigcal::testing

// First line of a test that needs the real recordings: sets `name`, or skips the test (fails it in
// CI, where missing data must not look like success).
#define RIGCAL_REQUIRE_RECORDED_DATA(name)                                                \
  const auto name##_or_none = ::rigcal::testing::RecordedDataDirectory();                 \
  if (!name##_or_none) {                                                                  \
    if (::rigcal::testing::RunsInCi()) FAIL() << "the real recordings are missing in CI"; \
    GTEST_SKIP() << "needs the real recordings (set RIGCAL_TEST_DATA)";                   \
  }                                                                                       \
  const std::filesystem::path name = *name##_or_none
