// SPDX-License-Identifier: Apache-2.0
// What earlier releases wrote, and sent, is understood: one folder protocol_<major>_<minor> for
// each version of the protocol that this release works with.
#include <gmock/gmock.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

#include "agent/spool/disk/disk_spool.h"
#include "common/wire/calibration_wire.h"
#include "common/wire/observation_wire.h"
#include "common/wire/protocol_version.h"
#include "common/wire/session_wire.h"
#include "server/store/factory/open_store.h"
#include "tests/golden/golden_content.h"
#include "tests/server/rpc/rpc_fixture.h"
#include "tests/testing/status_matchers.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing::golden_files_test {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

// Under tests/golden.
constexpr const char* kVersions[] = {"protocol_2_0"};

fs::path GoldenFolder(const std::string& version) {
  return fs::path(RIGCAL_SOURCE_DIR) / "tests/golden" / version;
}

std::string GoldenBytes(const std::string& version, const std::string& name) {
  const fs::path file = GoldenFolder(version) / "messages" / name;
  std::ifstream stream(file, std::ios::binary);
  EXPECT_TRUE(stream) << file;
  return {std::istreambuf_iterator<char>(stream), {}};
}

template <typename Message>
Message GoldenMessage(const std::string& version, const std::string& name) {
  Message message;
  EXPECT_TRUE(message.ParseFromString(GoldenBytes(version, name))) << name;
  return message;
}

void Decompress(const fs::path& from, const fs::path& to) {
  const gzFile file = gzopen(from.c_str(), "rb");
  ASSERT_NE(file, nullptr) << from;
  std::ofstream stream(to, std::ios::binary);
  std::array<char, 65536> buffer{};
  for (int got = 0; (got = gzread(file, buffer.data(), buffer.size())) > 0;) {
    stream.write(buffer.data(), got);
  }
  ASSERT_EQ(gzclose(file), Z_OK);
}

class GoldenFiles : public ::testing::TestWithParam<const char*> {
 protected:
  const TemporaryDirectory directory_;
};

TEST_P(GoldenFiles, TheDatabaseReadsLikeANewOneAndTakesMore) {
  const fs::path folder = directory_.path() / "golden";
  fs::create_directories(folder);
  ASSERT_NO_FATAL_FAILURE(
      Decompress(GoldenFolder(GetParam()) / "rigcal.db.gz", folder / "rigcal.db"));
  ASSERT_OK_AND_ASSIGN(const auto golden, server::OpenStore(folder.string()));
  ASSERT_OK_AND_ASSIGN(const auto fresh, server::OpenStore((directory_.path() / "new").string()));
  ASSERT_THAT(FillGoldenStore(fresh.get()), IsOk());
  EXPECT_THAT(golden->Health().problem, "");
  for (const char* id : {"wave", "running"}) {
    const auto rows = ReadRows(*golden, id);
    EXPECT_EQ(rows.size(), id == std::string("wave") ? 180u : 160u);
    EXPECT_TRUE(rows == ReadRows(*fresh, id)) << id;
    EXPECT_EQ(CountsText(*golden, id), CountsText(*fresh, id)) << id;
    ASSERT_OK_AND_ASSIGN(Session read, golden->GetSession(id));
    ASSERT_OK_AND_ASSIGN(Session written, fresh->GetSession(id));
    read.create_utc_ns = written.create_utc_ns = 0;
    EXPECT_EQ(wire::SerializeSession(read), wire::SerializeSession(written)) << id;
  }
  ASSERT_OK_AND_ASSIGN(const Calibration read, golden->GetCalibration("c-000001"));
  ASSERT_OK_AND_ASSIGN(const Calibration written, fresh->GetCalibration("c-000001"));
  ASSERT_TRUE(read.result.has_value());
  EXPECT_EQ(read.result->reference_camera, written.result->reference_camera);
  EXPECT_EQ(read.result->instant_count, 90u);
  EXPECT_EQ(read.session_ids, written.session_ids);

  // What arrived before is known, and what comes next is stored.
  ASSERT_THAT(golden->GetStream({"running", "left", 1}), IsOk());
  EXPECT_EQ(golden->GetStream({"running", "left", 1})->durable_seq, 50u);
  const auto append = [](server::Store& store) {
    server::Delivery delivery;
    delivery.batch = MakeBatch({"running", "left", 1}, 51, 60);
    return store.Append({&delivery, 1});
  };
  ASSERT_OK_AND_ASSIGN(const auto outcome, append(*golden));
  EXPECT_EQ(outcome[0].durable_seq, 100u);
  EXPECT_EQ(outcome[0].stored_rows, 10u);
  ASSERT_OK_AND_ASSIGN(const auto again, append(*golden));
  EXPECT_EQ(again[0].duplicate_rows, 10u);
}

TEST_P(GoldenFiles, TheSpoolIsDeliveredFromWhereItWas) {
  const fs::path folder = directory_.path() / "spool";
  fs::copy(GoldenFolder(GetParam()) / "spool", folder);
  agent::DiskSpoolOptions options;
  options.folder = folder.string();
  ASSERT_OK_AND_ASSIGN(const auto golden, agent::DiskSpool::Create(options));
  options.folder = (directory_.path() / "new").string();
  ASSERT_OK_AND_ASSIGN(const auto fresh, agent::DiskSpool::Create(options));
  ASSERT_THAT(FillGoldenSpool(fresh.get()), IsOk());
  ASSERT_THAT(golden->Streams(), SizeIs(2));
  for (const agent::SpooledStream& stream : golden->Streams()) {
    const auto same = fresh->Find(stream.stream);
    ASSERT_TRUE(same.has_value()) << stream.stream.camera;
    EXPECT_EQ(stream.end_seq, 31u);
    EXPECT_EQ(stream.durable_seq, same->durable_seq);
    EXPECT_TRUE(stream.dropped.empty());
    ASSERT_TRUE(stream.end.has_value()) << "the capture ended with the agent, at the latest";
    EXPECT_EQ(stream.end->last_seq, 30u);
    EXPECT_EQ(stream.end->interrupted, stream.stream.camera == "right");
    const uint32_t from = stream.durable_seq + 1;
    ASSERT_OK_AND_ASSIGN(const ObservationBatch read, golden->Read(stream.stream, from, 100));
    ASSERT_OK_AND_ASSIGN(const ObservationBatch written, fresh->Read(stream.stream, from, 100));
    EXPECT_EQ(read.rows(), 31 - from);
    EXPECT_EQ(ComparableBytes({read}), ComparableBytes({written}));
  }
}

TEST_P(GoldenFiles, EachMessageHasWhatWasWrittenAndNothingUnknown) {
  for (const auto& [name, bytes] : GoldenMessages()) {
    std::string error;
    google::protobuf::util::MessageDifferencer differencer;
    // Later releases may set more.
    differencer.set_scope(google::protobuf::util::MessageDifferencer::PARTIAL);
    differencer.ReportDifferencesToString(&error);
    const auto compare = [&](auto golden, auto written) {
      EXPECT_TRUE(golden.ParseFromString(GoldenBytes(GetParam(), name))) << name;
      EXPECT_TRUE(written.ParseFromString(bytes)) << name;
      EXPECT_NE(golden.message_case(), 0) << name;
      EXPECT_TRUE(differencer.Compare(golden, written)) << name << ": " << error;
    };
    if (name == "server_hello" || name == "start" || name == "ack") {
      compare(v1::ConnectResponse(), v1::ConnectResponse());
    } else {
      compare(v1::ConnectRequest(), v1::ConnectRequest());
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Versions, GoldenFiles, ::testing::ValuesIn(kVersions));

// An agent of that release, as it spoke.
class GoldenAgent : public RpcFixture, public ::testing::WithParamInterface<const char*> {
 protected:
  void StartGoldenWave() {
    v1::CreateSessionRequest request = WaveRequest("wave");
    ASSERT_THAT(client().CreateSession(request), IsOk());
    ASSERT_THAT(client().StartSession("wave"), IsOk());
  }
  v1::ConnectRequest Message(const std::string& name) const {
    return GoldenMessage<v1::ConnectRequest>(GetParam(), name);
  }
};

TEST_P(GoldenAgent, IsServed) {
  v1::ConnectRequest hello = Message("hello");
  hello.mutable_hello()->clear_pending();
  TestAgent agent(channel(), hello.hello());
  agent.ReadHello();
  ASSERT_NO_FATAL_FAILURE(StartGoldenWave());
  agent.ReadStart();
  agent.Send(Message("batch"));
  EXPECT_EQ(agent.ReadAck("left", 6).fault_count(), 0u);
  agent.Send(Message("report"));
  agent.Send(Message("end"));
  EXPECT_EQ(AwaitState("wave", v1::Session::STATE_FINISHED).observation_count(), 6u);
  EXPECT_THAT(agent.Finish(), IsOk());
}

TEST_P(GoldenAgent, OneMinorVersionNewerIsServedWithFieldsThatAreNotKnown) {
  v1::ConnectRequest hello = Message("hello");
  hello.mutable_hello()->clear_pending();
  hello.mutable_hello()->mutable_protocol_version()->set_minor(wire::kProtocolMinor + 1);
  hello.mutable_hello()
      ->GetReflection()
      ->MutableUnknownFields(hello.mutable_hello())
      ->AddLengthDelimited(500)
      ->assign("of a later release");
  TestAgent agent(channel(), hello.hello());
  EXPECT_EQ(agent.ReadHello().protocol_version().minor(), wire::kProtocolMinor);
}

TEST_P(GoldenAgent, TwoMinorVersionsNewerIsToldBoth) {
  v1::ConnectRequest hello = Message("hello");
  hello.mutable_hello()->mutable_protocol_version()->set_minor(wire::kProtocolMinor + 2);
  TestAgent agent(channel(), hello.hello());
  EXPECT_THAT(agent.AwaitEnd(), StatusIs(absl::StatusCode::kFailedPrecondition,
                                         AllOf(HasSubstr("'pc1'"), HasSubstr("speaks protocol 2.2"),
                                               HasSubstr("this side speaks 2.0"))));
}

INSTANTIATE_TEST_SUITE_P(Versions, GoldenAgent, ::testing::ValuesIn(kVersions));

}  // namespace
}  // namespace rigcal::testing::golden_files_test
