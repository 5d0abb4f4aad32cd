// SPDX-License-Identifier: Apache-2.0
#include "server/session/stream_context_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/session/session_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::testing::stream_context_cache_test {
namespace {

using server::StreamContextCache;
using ::testing::AllOf;
using ::testing::HasSubstr;

class StreamContextCacheTest : public ::testing::Test {
 protected:
  StreamContextCacheTest() {
    session_.id = "s-1";
    session_.state = SessionState::kCapturing;
    session_.cameras = {{MakeCamera("hand"), ""}, {MakeCamera("left"), "pc"}};
    cache_.Put(session_);
  }

  Session session_ = NewSession("s-1");
  StreamContextCache cache_;
};

TEST_F(StreamContextCacheTest, KnowsImageSizeAndMarkers) {
  ASSERT_OK_AND_ASSIGN(const server::StreamContext context,
                       cache_.GetStreamContext({"s-1", "left", 7}));
  EXPECT_EQ(context.image_size_px, (ImageSize{.width = 1280, .height = 1024}));
  EXPECT_EQ(context.marker_count, 3);
}

TEST_F(StreamContextCacheTest, NamesWhatItDoesNotKnow) {
  EXPECT_THAT(cache_.GetStreamContext({"s-2", "left", 1}),
              StatusIs(absl::StatusCode::kNotFound, HasSubstr("'s-2'")));
  EXPECT_THAT(cache_.GetStreamContext({"s-1", "top", 1}),
              StatusIs(absl::StatusCode::kNotFound, AllOf(HasSubstr("'s-1'"), HasSubstr("'top'"))));
}

TEST_F(StreamContextCacheTest, TakesNothingBeforeTheStartAndLateDataAfterTheEnd) {
  session_.state = SessionState::kCreated;
  cache_.Put(session_);
  EXPECT_THAT(cache_.GetStreamContext({"s-1", "left", 1}),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("not been started")));
  session_.state = SessionState::kFinished;
  cache_.Put(session_);
  EXPECT_THAT(cache_.GetStreamContext({"s-1", "left", 1}), IsOk());
}

TEST_F(StreamContextCacheTest, OnlyTheAgentThatTookPartMayDeliver) {
  EXPECT_THAT(cache_.CheckAgent({"s-1", "left", 1}, "pc", "rig"), IsOk());
  EXPECT_THAT(cache_.CheckAgent({"s-1", "left", 1}, "other", "rig"),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("'other'"), HasSubstr("'pc'"), HasSubstr("'left'"))));
  EXPECT_THAT(cache_.CheckAgent({"s-1", "hand", 1}, "pc", "rig"),
              StatusIs(absl::StatusCode::kPermissionDenied, HasSubstr("by hand")));
  EXPECT_THAT(cache_.CheckAgent({"s-1", "left", 1}, "pc", "elsewhere"),
              StatusIs(absl::StatusCode::kPermissionDenied,
                       AllOf(HasSubstr("'elsewhere'"), HasSubstr("'rig'"))));
}

TEST_F(StreamContextCacheTest, IsNotRemovedUnderAReader) {
  ASSERT_THAT(cache_.AddReader("s-1"), IsOk());
  EXPECT_THAT(cache_.Remove("s-1"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));
  cache_.Put(session_);  // a change of state keeps the readers
  EXPECT_THAT(cache_.Remove("s-1"),
              StatusIs(absl::StatusCode::kFailedPrecondition, HasSubstr("being read")));
  cache_.RemoveReader("s-1");
  EXPECT_THAT(cache_.Remove("s-1"), IsOk());
  EXPECT_THAT(cache_.AddReader("s-1"), StatusIs(absl::StatusCode::kNotFound, HasSubstr("'s-1'")));
  EXPECT_EQ(cache_.size(), 0u);
}

}  // namespace
}  // namespace rigcal::testing::stream_context_cache_test
