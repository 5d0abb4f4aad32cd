// SPDX-License-Identifier: Apache-2.0
#include "client/results/session_verification.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

using ReasonCounts = std::map<std::string, uint64_t>;

ReasonCounts CountsOf(const google::protobuf::RepeatedPtrField<v1::RefusalCount>& refusals) {
  ReasonCounts counts;
  for (const v1::RefusalCount& refusal : refusals) {
    counts[EnumWord(refusal.reason())] += refusal.count();
  }
  return counts;
}

std::string StateOf(const v1::StreamAudit& audit) {
  if (audit.ended()) return "complete";
  switch (audit.holder()) {
    case v1::StreamAudit::HOLDER_CONNECTED:
      return "with its agent";
    case v1::StreamAudit::HOLDER_AWAY:
      return "with its agent, which is away";
    case v1::StreamAudit::HOLDER_GONE:
      return "gone from its agent";
    default:
      return "without an agent";
  }
}

// What the agent may still have, by its own account.
uint64_t SpooledAtMost(const v1::StreamAudit& audit, uint64_t unstored) {
  const bool is_held = audit.holder() == v1::StreamAudit::HOLDER_CONNECTED ||
                       audit.holder() == v1::StreamAudit::HOLDER_AWAY;
  if (audit.ended() || !is_held) return 0;
  return audit.has_reported() ? audit.reported().spooled_count() : unstored;
}

std::string FaultOf(const v1::StreamAudit& audit, const VerifiedStream& stream, uint64_t surplus) {
  const std::string sum =
      absl::StrCat("camera ", stream.camera, ", stream ", stream.stream_epoch, ": detected ",
                   stream.detected, ", but durable ", stream.durable, " + spooled ", stream.spooled,
                   " + dropped ", stream.dropped_count());
  if (stream.missing > 0) return absl::StrCat(sum, ": ", stream.missing, " are missing");
  if (surplus > 0) return absl::StrCat(sum, ": ", surplus, " too many");
  const std::string name =
      absl::StrCat("camera ", stream.camera, ", stream ", stream.stream_epoch, ": ");
  if (audit.reported().acknowledged_seq() > audit.durable_seq()) {
    return absl::StrCat(name, "the server had acknowledged all up to ",
                        audit.reported().acknowledged_seq(), ", and has them up to ",
                        audit.durable_seq());
  }
  if (!audit.ended() && audit.holder() == v1::StreamAudit::HOLDER_GONE) {
    return absl::StrCat(name, "agent ", audit.agent_id(),
                        " does not have the stream any more, and its end never came: what was "
                        "detected after observation ",
                        stream.detected, " is not known");
  }
  return "";
}

VerifiedStream VerifyStream(const v1::StreamAudit& audit) {
  VerifiedStream stream;
  stream.camera = audit.camera();
  stream.stream_epoch = audit.stream_epoch();
  stream.state = StateOf(audit);
  stream.detected = std::max({audit.last_seq(), audit.reported().last_seq(), audit.highest_seq()});
  stream.durable = audit.stored_count();
  stream.dropped = CountsOf(audit.dropped());
  const uint64_t known = stream.durable + stream.dropped_count();
  const uint64_t surplus = known > stream.detected ? known - stream.detected : 0;
  uint64_t unstored = stream.detected + surplus - known;
  // Dropped, and the server has not been told yet.
  for (const auto& [reason, count] : CountsOf(audit.reported().dropped())) {
    uint64_t& told = stream.dropped[reason];
    const uint64_t untold = std::min(count > told ? count - told : 0, unstored);
    told += untold;
    unstored -= untold;
    if (told == 0) stream.dropped.erase(reason);
  }
  stream.spooled = std::min(unstored, SpooledAtMost(audit, unstored));
  stream.missing = unstored - stream.spooled;
  stream.fault = FaultOf(audit, stream, surplus);
  return stream;
}

}  // namespace

bool SessionVerification::holds() const {
  return std::ranges::all_of(streams,
                             [](const VerifiedStream& stream) { return stream.fault.empty(); });
}

SessionVerification VerifySession(const v1::GetSessionResponse& response) {
  SessionVerification verification;
  verification.session_id = response.session().id();
  for (const v1::StreamAudit& audit : response.audit()) {
    verification.streams.push_back(VerifyStream(audit));
    VerifiedStream& stream = verification.streams.back();
    if (stream.missing == 0 || !response.session().has_observations_delete_time()) continue;
    stream.fault = absl::StrCat("camera ", stream.camera, ", stream ", stream.stream_epoch,
                                ": the server's retention has deleted the observations, so they "
                                "cannot be counted any more");
  }
  return verification;
}

std::string FormatVerification(const SessionVerification& verification) {
  if (verification.streams.empty()) {
    return Printable(absl::StrCat("session ", verification.session_id, " has no streams yet\n"));
  }
  TextTable table;
  table.Words({"camera"})
      .Numbers({"stream", "detected", "durable", "spooled", "dropped", "missing"})
      .Words({"where it is", "dropped because"});
  uint64_t detected = 0, durable = 0, spooled = 0, dropped = 0;
  std::vector<std::string> faults;
  for (const VerifiedStream& stream : verification.streams) {
    table.AddRow({stream.camera, stream.stream_epoch, stream.detected, stream.durable,
                  stream.spooled, stream.dropped_count(), stream.missing, stream.state,
                  stream.dropped.empty()
                      ? "-"
                      : absl::StrJoin(stream.dropped, ", ", absl::PairFormatter(" "))});
    detected += stream.detected;
    durable += stream.durable;
    spooled += stream.spooled;
    dropped += stream.dropped_count();
    if (!stream.fault.empty()) faults.push_back(stream.fault);
  }
  std::string text = table.Format() + "\n";
  if (faults.empty()) {
    return absl::StrCat(text, "verified: ", detected, " detected = ", durable, " durable + ",
                        spooled, " spooled + ", dropped, " dropped\n");
  }
  for (const std::string& fault : faults) {
    absl::StrAppend(&text, "not verified: ", Printable(fault), "\n");
  }
  return text;
}

std::string VerificationJson(const SessionVerification& verification) {
  using Json = nlohmann::ordered_json;
  Json streams = Json::array();
  for (const VerifiedStream& stream : verification.streams) {
    streams.push_back({{"camera", stream.camera},
                       {"stream_epoch", stream.stream_epoch},
                       {"state", stream.state},
                       {"detected", stream.detected},
                       {"durable", stream.durable},
                       {"spooled", stream.spooled},
                       {"dropped", Json(stream.dropped)},
                       {"missing", stream.missing},
                       {"fault", stream.fault}});
  }
  return JsonText(Json{{"session", verification.session_id},
                       {"holds", verification.holds()},
                       {"streams", std::move(streams)}});
}

}  // namespace rigcal::client
