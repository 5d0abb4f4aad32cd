// SPDX-License-Identifier: Apache-2.0
// Deliveries in any order, cut and joined in any way, repeated at will, end in the same rows and
// the same counts.

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cstdlib>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "tests/server/store/contract/store_contract.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::server::delivery_order_test {
namespace {

using ::rigcal::testing::CapturingSession;
using ::rigcal::testing::CountsText;
using ::rigcal::testing::EndDelivery;
using ::rigcal::testing::IsOk;
using ::rigcal::testing::KeyOf;
using ::rigcal::testing::MakeBatch;
using ::rigcal::testing::MakeDelivery;
using ::rigcal::testing::NewLocation;
using ::rigcal::testing::OpenStoreAt;
using ::rigcal::testing::ReadRows;
using ::rigcal::testing::TemporaryDirectory;

// One seed unless RC_PARAMS asks for another; rapidcheck prints how to repeat a failure.
[[maybe_unused]] const int kSeedIsSet = setenv("RC_PARAMS", "seed=20 max_success=60", 0);

constexpr uint32_t kRows = 60;       // of each stream
constexpr uint32_t kEpochRows = 25;  // of the first clock epoch

bool IsRefused(uint32_t seq) { return seq % 11 == 0; }

std::vector<StreamKey> Streams() { return {KeyOf("a", 1), KeyOf("a", 2), KeyOf("b", 1)}; }

// Rows [first, last] of a stream as an agent would send them: one clock epoch only.
Delivery Part(const StreamKey& stream, uint32_t first, uint32_t last) {
  Delivery delivery = MakeDelivery(MakeBatch(stream, first, last, first <= kEpochRows ? 0u : 1u));
  for (uint32_t seq = first; seq <= last; ++seq) {
    if (!IsRefused(seq)) continue;
    const uint32_t row = seq - first;
    delivery.batch.x_px[3 * row] = std::numeric_limits<float>::quiet_NaN();
    delivery.refused_rows.push_back(
        {.row = row, .reason = RefusalReason::kNotFinite, .detail = "not finite"});
  }
  return delivery;
}

// 61 to 70 were lost at the agent.
Delivery Dropped(const StreamKey& stream, uint32_t first, uint32_t count) {
  Delivery delivery;
  delivery.batch.stream = stream;
  delivery.batch.dropped = {
      {.first_seq = first, .count = count, .reason = RefusalReason::kSpoolFreed}};
  return delivery;
}

struct Stored {
  std::vector<std::pair<testing::RowKey, testing::StoredRow>> rows;
  std::string counts;
};

// The contents of a new store after these deliveries, `group` of them per transaction; the store is
// reopened after `reopen_after` transactions.
Stored Deliver(const std::string& kind, const std::vector<Delivery>& deliveries, size_t group,
               size_t reopen_after) {
  const TemporaryDirectory directory;
  const std::string location = NewLocation(kind, directory.path());
  auto store = OpenStoreAt(location);
  EXPECT_THAT(store, IsOk());
  EXPECT_THAT((*store)->CreateSession(CapturingSession({"a", "b"})), IsOk());
  size_t transactions = 0;
  for (size_t begin = 0; begin < deliveries.size(); begin += group) {
    const auto part = absl::MakeSpan(deliveries).subspan(begin, group);
    EXPECT_THAT((*store)->Append(part), IsOk());
    if (++transactions != reopen_after) continue;
    store->reset();
    store = OpenStoreAt(location);
    EXPECT_THAT(store, IsOk());
  }
  return {.rows = ReadRows(**store), .counts = CountsText(**store)};
}

const Stored& InOrder() {
  static const Stored stored = [] {
    std::vector<Delivery> deliveries;
    for (const StreamKey& stream : Streams()) {
      deliveries.push_back(Part(stream, 1, kEpochRows));
      deliveries.push_back(Part(stream, kEpochRows + 1, kRows));
      deliveries.push_back(Dropped(stream, kRows + 1, 10));
      deliveries.push_back(EndDelivery(stream, kRows + 10));
    }
    return Deliver("sqlite", deliveries, deliveries.size(), 0);
  }();
  return stored;
}

// Parts that cover the rows [first, last], cut at random, with random repetitions that overlap.
void AddParts(const StreamKey& stream, uint32_t first, uint32_t last,
              std::vector<Delivery>* deliveries) {
  for (uint32_t begin = first; begin <= last;) {
    const uint32_t end = *rc::gen::inRange(begin, std::min(last, begin + 20) + 1);
    deliveries->push_back(Part(stream, begin, end));
    begin = end + 1;
  }
  const int repetitions = *rc::gen::inRange(0, 4);
  for (int i = 0; i < repetitions; ++i) {
    const uint32_t begin = *rc::gen::inRange(first, last + 1);
    deliveries->push_back(Part(stream, begin, *rc::gen::inRange(begin, last + 1)));
  }
}

std::vector<Delivery> ArbitraryDeliveries() {
  std::vector<Delivery> deliveries;
  for (const StreamKey& stream : Streams()) {
    AddParts(stream, 1, kEpochRows, &deliveries);
    AddParts(stream, kEpochRows + 1, kRows, &deliveries);
    const uint32_t cut = *rc::gen::inRange(1u, 10u);
    deliveries.push_back(Dropped(stream, kRows + 1, cut));
    deliveries.push_back(Dropped(stream, kRows + cut, 11 - cut));
    deliveries.push_back(EndDelivery(stream, kRows + 10));
  }
  for (size_t i = deliveries.size(); i > 1; --i) {
    std::swap(deliveries[i - 1], deliveries[*rc::gen::inRange<size_t>(0, i)]);
  }
  return deliveries;
}

class DeliveryOrder : public ::testing::TestWithParam<std::string> {};

TEST_P(DeliveryOrder, EndsInTheSameRowsAndCounts) {
  ASSERT_EQ(InOrder().rows.size(), 3 * kRows);
  EXPECT_TRUE(rc::check([this] {
    const std::vector<Delivery> deliveries = ArbitraryDeliveries();
    const size_t group = *rc::gen::inRange<size_t>(1, 12);
    const size_t reopen_after = *rc::gen::inRange<size_t>(0, 12);
    const Stored stored = Deliver(GetParam(), deliveries, group, reopen_after);
    RC_ASSERT(stored.counts == InOrder().counts);
    RC_ASSERT(stored.rows == InOrder().rows);
  }));
}

TEST_P(DeliveryOrder, EndsInTheSameForSingleObservationsBackwardsAndTwice) {
  std::vector<Delivery> deliveries;
  for (const int repetition : {1, 2}) {
    static_cast<void>(repetition);
    for (const StreamKey& stream : Streams()) {
      deliveries.push_back(EndDelivery(stream, kRows + 10));
      for (uint32_t seq = kRows + 10; seq > kRows; --seq)
        deliveries.push_back(Dropped(stream, seq, 1));
      for (uint32_t seq = kRows; seq >= 1; --seq) deliveries.push_back(Part(stream, seq, seq));
    }
  }
  const Stored stored = Deliver(GetParam(), deliveries, 40, 3);
  EXPECT_EQ(stored.counts, InOrder().counts);
  EXPECT_EQ(stored.rows, InOrder().rows);
}

RIGCAL_FOR_EVERY_STORE(DeliveryOrder);

}  // namespace
}  // namespace rigcal::server::delivery_order_test
