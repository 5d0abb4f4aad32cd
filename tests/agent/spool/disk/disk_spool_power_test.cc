// SPDX-License-Identifier: Apache-2.0
// The power fails, or the process is killed, at every call that changes the disk (P2): what was
// synced and not acknowledged is there afterwards, what was appended survives a kill.
#include <gmock/gmock.h>
#include <rapidcheck.h>

#include <map>
#include <set>
#include <string>

#include "tests/agent/spool/disk/spool_reading.h"

namespace rigcal::agent::disk_spool_power_test {
namespace {

// What is known of a stream before the end of the process.
struct Known {
  uint32_t appended = 0;  // Append returned OK
  uint32_t synced = 0;
  uint32_t acknowledged = 0;
  bool discarded = false;
};

// Drives a spool of small segments, and stops at the first error.
class Scenario {
 public:
  explicit Scenario(ModelFileSystem* files) : files_(*files) {}

  static DiskSpoolOptions Options() {
    DiskSpoolOptions options = ModelOptions();
    options.limit_bytes = uint64_t{256} << 10;  // segments of 16 KiB, some 240 rows
    return options;
  }

  void Run() {
    auto opened = DiskSpool::Create(Options(), &files_);
    if (!opened.ok()) return;
    spool_ = *std::move(opened);
    for (const char* camera : {"a", "b", "c"}) {
      if (!spool_->Open(Key(camera), 1, 1).ok()) return;
    }
    for (int round = 0; round < 12; ++round) {
      if (!Append("a", 60) || !Append("b", 25) || (round < 5 && !Append("c", 10))) break;
      spool_->Maintain();
      NoteSynced();
      if (round >= 2) Acknowledge("a", static_cast<uint32_t>(60 * (round - 1)));
      if (round == 8) Acknowledge("b", 200);
      if (round == 5) {
        known_["c"].discarded = true;
        spool_->Discard(Key("c"));
      }
      if (round == 10 && spool_->Finish(Key("b"), {}).ok()) break;
    }
    spool_->Maintain();
    NoteSynced();
  }
  // Ends the process at once.
  void Kill() {
    if (spool_) agent::Kill(spool_, files_);
  }

  static StreamKey Key(const std::string& camera) { return {"s-1", camera, 3}; }
  const std::map<std::string, Known>& known() const { return known_; }

 private:
  bool Append(const std::string& camera, uint32_t rows) {
    for (uint32_t row = 0; row < rows; ++row) {
      Known& known = known_[camera];
      const auto seq =
          spool_->Append(Key(camera), MakeObservation((known.appended + 1) * kRowNs), {});
      if (!seq.ok()) return false;
      EXPECT_EQ(*seq, known.appended + 1);
      known.appended = *seq;
    }
    return true;
  }
  void NoteSynced() {
    for (auto& [camera, known] : known_) {
      const auto spooled = spool_->Find(Key(camera));
      if (spooled) known.synced = spooled->synced_seq;
    }
  }
  void Acknowledge(const std::string& camera, uint32_t seq) {
    spool_->Acknowledge(Key(camera), seq);
    known_[camera].acknowledged = seq;
  }

  ModelFileSystem& files_;
  std::unique_ptr<DiskSpool> spool_;
  std::map<std::string, Known> known_;
};

// `survives`: what must be there of a stream.
void CheckAfterRestart(ModelFileSystem& files, const Scenario& scenario,
                       uint32_t Known::*survives) {
  auto spool = OpenSpool(files, Scenario::Options());
  ASSERT_NE(spool, nullptr);
  std::set<std::string> found;
  for (const SpooledStream& stream : spool->Streams()) {
    const std::string& camera = stream.stream.camera;
    found.insert(camera);
    ASSERT_TRUE(scenario.known().contains(camera) || stream.row_count == 0);
    if (!scenario.known().contains(camera)) continue;
    const Known& known = scenario.known().at(camera);
    ASSERT_TRUE(stream.end);
    const ReadStreamRows read = ReadRows(*spool, stream.stream, stream.durable_seq + 1);
    for (uint32_t seq = known.acknowledged + 1; seq <= known.*survives; ++seq) {
      ASSERT_TRUE(read.rows.contains(seq)) << camera << " " << seq;
    }
    for (const uint32_t seq : read.rows) {
      ASSERT_LE(seq, known.appended + 1) << camera << ": never appended";
    }
    for (const auto& [seq, reason] : read.dropped) {
      ASSERT_GT(seq, known.*survives) << camera << ": a row that survives counts as lost";
    }
    ASSERT_LE(stream.durable_seq, known.acknowledged) << camera;
    EXPECT_EQ(stream.row_count, read.rows.size()) << camera;
    EXPECT_EQ(stream.end->last_seq + 1, stream.end_seq);
  }
  for (const auto& [camera, known] : scenario.known()) {
    if (known.discarded || known.*survives <= known.acknowledged) continue;
    ASSERT_TRUE(found.contains(camera)) << camera;
  }
}

int CallsOfARun() {
  ModelFileSystem files;
  Scenario scenario(&files);
  scenario.Run();
  EXPECT_EQ(scenario.known().at("a").appended, 660u) << "the scenario was not run to its end";
  return files.calls();
}

TEST(DiskSpoolPower, KeepsWhatWasSyncedWhenThePowerFailsAtAnyCall) {
  const int calls = CallsOfARun();
  ASSERT_GT(calls, 500);
  for (int call = 1; call <= calls; ++call) {
    SCOPED_TRACE(call);
    ModelFileSystem files;
    Scenario scenario(&files);
    files.CutPowerAt(call);
    scenario.Run();
    scenario.Kill();
    // A part of what was not synced may have reached the disk, cut anywhere.
    files.PowerCut(static_cast<size_t>(call) * 37 % 2000 * (call % 2));
    ASSERT_NO_FATAL_FAILURE(CheckAfterRestart(files, scenario, &Known::synced));
  }
}

TEST(DiskSpoolPower, KeepsWhatWasAppendedWhenItsProcessIsKilledAtAnyCall) {
  const int calls = CallsOfARun();
  for (int call = 1; call <= calls; ++call) {
    SCOPED_TRACE(call);
    ModelFileSystem files;
    Scenario scenario(&files);
    files.CutPowerAt(call);
    scenario.Run();
    scenario.Kill();
    files.Thaw();
    ASSERT_NO_FATAL_FAILURE(CheckAfterRestart(files, scenario, &Known::appended));
  }
}

TEST(DiskSpoolPower, KeepsWhatWasSyncedOverSeveralPowerCuts) {
  const bool holds = rc::check([] {
    ModelFileSystem files;
    std::map<StreamKey, Known> known;
    const int runs = *rc::gen::inRange(1, 5);
    for (int run = 0; run < runs; ++run) {
      auto opened = DiskSpool::Create(Scenario::Options(), &files);
      RC_ASSERT(opened.ok());
      auto spool = *std::move(opened);
      for (const auto& [stream, was] : known) {
        const auto spooled = spool->Find(stream);
        if (was.synced > was.acknowledged) RC_ASSERT(spooled.has_value());
        if (!spooled) continue;
        const ReadStreamRows read = ReadRows(*spool, stream, spooled->durable_seq + 1);
        for (uint32_t seq = was.acknowledged + 1; seq <= was.synced; ++seq) {
          RC_ASSERT(read.rows.contains(seq));
        }
      }
      files.CutPowerAt(*rc::gen::inRange(1, 400));
      const StreamKey stream{"s-1", "a", static_cast<uint32_t>(run + 1)};
      if (spool->Open(stream, 1, 1).ok()) known[stream];
      const int steps = *rc::gen::inRange(1, 30);
      for (int step = 0; step < steps; ++step) {
        Known& now = known[stream];
        const int rows = *rc::gen::inRange(1, 100);
        for (int row = 0; row < rows; ++row) {
          if (!spool->Append(stream, MakeObservation((now.appended + 1) * kRowNs), {}).ok()) break;
          ++now.appended;
        }
        spool->Maintain();
        if (const auto spooled = spool->Find(stream)) now.synced = spooled->synced_seq;
        for (auto& [key, any] : known) {
          if (*rc::gen::inRange(0, 3) != 0) continue;
          any.acknowledged = *rc::gen::inRange(any.acknowledged, any.appended + 1);
          spool->Acknowledge(key, any.acknowledged);
        }
      }
      Kill(spool, files);
      files.PowerCut(*rc::gen::inRange<size_t>(0, 3000));
    }
  });
  EXPECT_TRUE(holds);
}

}  // namespace
}  // namespace rigcal::agent::disk_spool_power_test
