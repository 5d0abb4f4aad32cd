// SPDX-License-Identifier: Apache-2.0
#include "server/store/batch_blob.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <string>

#include "server/store/record_checksum.h"
#include "tests/server/store/store_fixture.h"
#include "tests/testing/status_matchers.h"

namespace rigcal::server::batch_blob_test {
namespace {

using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::StatusIs;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Encode(const ObservationBatch& batch, size_t begin, size_t end,
                   const std::vector<RefusedRow>& refused = {}) {
  std::string blob;
  EncodeBatch(batch, refused, begin, end, &blob);
  return blob;
}

// With a valid checksum.
void SealAgain(std::string* blob) {
  const uint32_t checksum = Checksum(std::string_view(*blob).substr(0, blob->size() - 4));
  std::memcpy(blob->data() + blob->size() - 4, &checksum, 4);
}

void ExpectSameRows(const ObservationBatch& actual, const ObservationBatch& expected) {
  EXPECT_EQ(actual.stream, expected.stream);
  EXPECT_EQ(actual.first_seq, expected.first_seq);
  EXPECT_EQ(actual.clock_epoch, expected.clock_epoch);
  EXPECT_EQ(actual.marker_count, expected.marker_count);
  EXPECT_EQ(actual.time_ns, expected.time_ns);
  EXPECT_EQ(actual.visible_mask, expected.visible_mask);
  EXPECT_EQ(actual.x_px, expected.x_px);
  EXPECT_EQ(actual.y_px, expected.y_px);
  EXPECT_EQ(actual.cov_xx_px2, expected.cov_xx_px2);
  EXPECT_EQ(actual.cov_xy_px2, expected.cov_xy_px2);
  EXPECT_EQ(actual.cov_yy_px2, expected.cov_yy_px2);
  EXPECT_EQ(actual.time_delta_ns, expected.time_delta_ns);
  EXPECT_EQ(actual.label_confidence, expected.label_confidence);
  EXPECT_EQ(actual.centre_kind, expected.centre_kind);
}

TEST(BatchBlob, GivesBackEveryColumn) {
  const ObservationBatch batch = MakeBatch(KeyOf("a", 3), 11, 40, 2);
  ASSERT_OK_AND_ASSIGN(const StoredBatch stored,
                       DecodeBatch(Encode(batch, 0, batch.rows()), KeyOf("a", 3), 11));
  ExpectSameRows(stored.batch, batch);
  EXPECT_TRUE(stored.refused_rows.empty());
}

TEST(BatchBlob, GivesBackAPartUnderItsOwnNumbers) {
  const ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 30);
  ASSERT_OK_AND_ASSIGN(const StoredBatch stored, DecodeBatch(Encode(batch, 7, 19), KeyOf("a"), 8));
  ExpectSameRows(stored.batch, MakeBatch(KeyOf("a"), 8, 19));
}

TEST(BatchBlob, GivesBackRowsWithoutMarkers) {
  ObservationBatch batch = MakeBatch(KeyOf("a"), 5, 5);  // an empty observation
  ASSERT_EQ(batch.visible_mask[0], 0u);
  ASSERT_OK_AND_ASSIGN(const StoredBatch stored, DecodeBatch(Encode(batch, 0, 1), KeyOf("a"), 5));
  ExpectSameRows(stored.batch, batch);
}

TEST(BatchBlob, MarksRefusedRowsOfThePartAndKeepsTheirValues) {
  ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 20);
  batch.x_px[3 * 9] = std::numeric_limits<float>::quiet_NaN();
  batch.x_px[3 * 16] = std::numeric_limits<float>::infinity();
  const std::vector<RefusedRow> refused = {
      {.row = 2, .reason = RefusalReason::kNotFinite, .detail = "d"},
      {.row = 9, .reason = RefusalReason::kNotFinite, .detail = "d"},
      {.row = 16, .reason = RefusalReason::kNotFinite, .detail = "d"}};
  ASSERT_OK_AND_ASSIGN(const StoredBatch stored,
                       DecodeBatch(Encode(batch, 5, 18, refused), KeyOf("a"), 6));
  ASSERT_EQ(stored.refused_rows.size(), 13u);
  for (size_t row = 0; row < 13; ++row) {
    EXPECT_EQ(stored.refused_rows[row], row == 4 || row == 11) << row;
  }
  EXPECT_TRUE(std::isnan(stored.batch.x_px[3 * 4]));
  EXPECT_TRUE(std::isinf(stored.batch.x_px[3 * 11]));
}

TEST(BatchBlob, IsSmallWhereColumnsAreConstant) {
  ObservationBatch batch = MakeBatch(KeyOf("a"), 1, 16);
  const size_t varied = Encode(batch, 0, 16).size();
  batch.cov_xx_px2.assign(48, 0.25f);
  batch.cov_xy_px2.assign(48, 0.0f);
  batch.cov_yy_px2.assign(48, 0.25f);
  batch.time_delta_ns.assign(48, 0);
  batch.label_confidence.assign(48, 1.0f);
  batch.centre_kind.assign(48, 1);
  const std::string blob = Encode(batch, 0, 16);
  EXPECT_LT(2 * blob.size(), varied);
  ASSERT_OK_AND_ASSIGN(const StoredBatch stored, DecodeBatch(blob, KeyOf("a"), 1));
  ExpectSameRows(stored.batch, batch);
}

TEST(BatchBlob, NoticesEveryFlippedBit) {
  const std::string blob = Encode(MakeBatch(KeyOf("a"), 1, 3), 0, 3);
  for (size_t bit = 0; bit < 8 * blob.size(); ++bit) {
    std::string damaged = blob;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
    EXPECT_THAT(DecodeBatch(damaged, KeyOf("a"), 1),
                StatusIs(absl::StatusCode::kDataLoss, ::testing::_))
        << "bit " << bit;
  }
}

TEST(BatchBlob, NamesStreamAndSeqOfWhatIsDamaged) {
  std::string blob = Encode(MakeBatch(KeyOf("left", 4), 70, 73), 0, 4);
  blob[30] = static_cast<char>(blob[30] ^ 1);
  EXPECT_THAT(DecodeBatch(blob, KeyOf("left", 4), 70),
              StatusIs(absl::StatusCode::kDataLoss,
                       AllOf(HasSubstr("session s-test"), HasSubstr("camera left"),
                             HasSubstr("stream epoch 4"), HasSubstr("seq 70"))));
}

TEST(BatchBlob, NoticesEveryLengthItCanBeCutTo) {
  const std::string blob = Encode(MakeBatch(KeyOf("a"), 1, 3), 0, 3);
  for (size_t size = 0; size < blob.size(); ++size) {
    EXPECT_THAT(DecodeBatch(blob.substr(0, size), KeyOf("a"), 1),
                StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
    if (size < 4) continue;
    std::string sealed = blob.substr(0, size);
    SealAgain(&sealed);
    EXPECT_THAT(DecodeBatch(sealed, KeyOf("a"), 1),
                StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
  }
  EXPECT_THAT(DecodeBatch(blob + "x", KeyOf("a"), 1),
              StatusIs(absl::StatusCode::kDataLoss, ::testing::_));
}

// Sizes in the header are checked even where the checksum is right.
TEST(BatchBlob, DoesNotTrustSizes) {
  const std::string blob = Encode(MakeBatch(KeyOf("a"), 1, 3), 0, 3);
  for (const size_t offset : {6u, 12u, 20u}) {  // marker_count, row_count, refused_count
    for (const uint32_t value : {0u, 1u, 2u, 4u, 17u, 0xffffu, 0x10000u, 0x100001u, 0xffffffffu}) {
      std::string lying = blob;
      std::memcpy(lying.data() + offset, &value, offset == 6 ? 2 : 4);
      if (lying == blob) continue;
      SealAgain(&lying);
      if (offset == 20 && value == 0) continue;  // the original value
      EXPECT_THAT(DecodeBatch(lying, KeyOf("a"), 1),
                  StatusIs(absl::StatusCode::kDataLoss, ::testing::_))
          << "offset " << offset << " value " << value;
    }
  }
}

TEST(BatchBlob, RefusesOtherVersionsAndMisplacedRows) {
  std::string blob = Encode(MakeBatch(KeyOf("a"), 1, 3), 0, 3);
  EXPECT_THAT(DecodeBatch(blob, KeyOf("a"), 2),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("holds seq 1")));
  blob[4] = 9;
  SealAgain(&blob);
  EXPECT_THAT(DecodeBatch(blob, KeyOf("a"), 1),
              StatusIs(absl::StatusCode::kDataLoss, HasSubstr("format version is 9")));
}

}  // namespace
}  // namespace rigcal::server::batch_blob_test
