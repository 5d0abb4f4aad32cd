// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <thread>

#include "common/wire/grpc_status.h"
#include "rigcal/v1/lens_service.grpc.pb.h"
#include "tests/server/lens/board_session.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::lens_service_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

class LensService : public RpcFixture {
 protected:
  absl::StatusOr<v1::Lens> Get(const std::string& camera, const std::string& session = "s-test") {
    grpc::ClientContext context;
    v1::GetLensRequest request;
    request.set_session_id(session);
    request.set_camera(camera);
    v1::GetLensResponse response;
    const absl::Status status =
        wire::FromGrpc(v1::LensService::NewStub(channel())->GetLens(&context, request, &response));
    if (!status.ok()) return status;
    return response.lens();
  }
  v1::Lens Await(v1::Lens::State state) {
    absl::StatusOr<v1::Lens> lens;
    for (int i = 0; i < 600; ++i) {
      lens = Get("left");
      if (!lens.ok() || lens->state() == state) break;
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
    }
    EXPECT_THAT(lens, IsOk());
    return *lens;
  }
};

TEST_F(LensService, MakesALensThatAFileHolds) {
  ASSERT_THAT(store().CreateSession(OfBoard(CapturingSession({"left"}))), IsOk());
  Append(RowsOfViews(KeyOf("left"), 1, WavedViews(12)));
  const v1::Lens lens = Await(v1::Lens::STATE_SOLVED);
  EXPECT_EQ(lens.board(), "board:checker,9x6,0.03");
  EXPECT_FALSE(lens.has_lens());
  EXPECT_EQ(lens.stored_count(), 12u);
  EXPECT_EQ(lens.observation_count(), 12u);
  EXPECT_THAT(lens.problem(), IsEmpty());
  ASSERT_EQ(static_cast<uint64_t>(lens.views_size()),
            12 - lens.alike_count() - lens.blurred_count());
  EXPECT_EQ(lens.views(0).x_px_size(), lens.views(0).y_px_size());
  EXPECT_GT(lens.views(0).rms_px(), 0);
  EXPECT_GT(lens.covered_share(), 0.3);
  const v1::LensResult& result = lens.result();
  EXPECT_EQ(result.observation_count(), 12u);
  EXPECT_NEAR(result.intrinsics().fx_px(), 520, 2);
  EXPECT_EQ(result.candidates_size(), 4);
  EXPECT_THAT(result.opencv_yaml(), StartsWith("%YAML"));
  EXPECT_THAT(result.opencv_yaml(), HasSubstr("image_width: 640"));
  EXPECT_THAT(result.opencv_yaml(), Not(HasSubstr("extrinsics")));
  EXPECT_EQ(lens.uncertainty().columns() * lens.uncertainty().rows(),
            static_cast<uint32_t>(lens.uncertainty().values_px_size()));
  EXPECT_GT(lens.uncertainty().p95_px(), 0);
  EXPECT_THAT(lens.next_pose().words(), Not(IsEmpty()));
  EXPECT_EQ(lens.next_pose().outline_x_px_size(), 4);
}

TEST_F(LensService, SaysWhatIsMissing) {
  ASSERT_THAT(store().CreateSession(OfBoard(CapturingSession({"left"}))), IsOk());
  const v1::Lens lens = Await(v1::Lens::STATE_COLLECTING);
  EXPECT_THAT(lens.problem(), HasSubstr("nothing has been recorded"));
  EXPECT_FALSE(lens.has_result());
  EXPECT_THAT(lens.next_pose().words(), Not(IsEmpty()));
  EXPECT_EQ(lens.next_pose().outline_x_px_size(), 0);
  EXPECT_THAT(Get(""), StatusIs(absl::StatusCode::kInvalidArgument, HasSubstr("camera")));
  EXPECT_THAT(Get("top"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("it has left")));
  EXPECT_THAT(Get("left", "s-none"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("s-none")));
  Session wave = CapturingSession({"left"});
  wave.id = "wave";
  ASSERT_THAT(store().CreateSession(wave), IsOk());
  EXPECT_THAT(Get("left", "wave"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("is no board")));
}

}  // namespace
}  // namespace rigcal::testing::lens_service_test
