// SPDX-License-Identifier: Apache-2.0
#include "common/status/fault_list.h"

#include <cstdint>
#include <limits>

#include "tests/testing/status_matchers.h"

namespace rigcal::fault_list_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::StatusIs;

TEST(FaultList, WithoutFaultsIsOk) {
  FaultList faults;
  faults.Add(absl::OkStatus());
  faults.CheckRange("share", 0.0, 0, 1);
  faults.CheckRange("share", 1.0, 0, 1);
  EXPECT_THAT(faults.Result("options: "), IsOk());
}

TEST(FaultList, NamesEveryFaultInOrder) {
  FaultList faults;
  faults.Add("marker ", 3, " is missing");
  faults.Add(absl::NotFoundError("no such camera"));
  faults.CheckRange("exposure", 10.5, 1e-6, 10, " s");
  EXPECT_THAT(faults.Result("options: "),
              StatusIs(absl::StatusCode::kInvalidArgument,
                       "options: marker 3 is missing; no such camera; exposure is 10.5 s, it must "
                       "be 1e-06 to 10 s"));
}

TEST(FaultList, RefusesWhatIsNotANumber) {
  FaultList faults;
  faults.CheckRange("gain", std::numeric_limits<double>::quiet_NaN(), 0, 1);
  EXPECT_THAT(faults.Result(),
              StatusIs(absl::StatusCode::kInvalidArgument, "gain is nan, it must be 0 to 1"));
}

TEST(FaultList, PrintsWholeNumbersInFull) {
  FaultList faults;
  faults.CheckRange("bytes", uint64_t{1} << 31, 65'536, 1 << 30);
  EXPECT_THAT(faults.Result(), StatusIs(absl::StatusCode::kInvalidArgument,
                                        "bytes is 2147483648, it must be 65536 to 1073741824"));
}

}  // namespace
}  // namespace rigcal::fault_list_test
