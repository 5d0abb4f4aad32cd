// SPDX-License-Identifier: Apache-2.0
#include "client/results/session_verification.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "client/output/console.h"
#include "client/output/output.h"
#include "client/output/quantities.h"
#include "client/output/text_table.h"

namespace rigcal::client {
namespace {

// Ranges of numbers that a sentence names.
constexpr size_t kMaxNamedRanges = 5;

using ReasonCounts = std::map<std::string, uint64_t>;
using SeqRanges = google::protobuf::RepeatedPtrField<v1::SeqRange>;

ReasonCounts CountsOf(const google::protobuf::RepeatedPtrField<v1::RefusalCount>& refusals) {
  ReasonCounts counts;
  for (const v1::RefusalCount& refusal : refusals) {
    counts[EnumWord(refusal.reason())] += refusal.count();
  }
  return counts;
}

std::vector<VerifiedRows> RowsOf(const SeqRanges& ranges) {
  std::vector<VerifiedRows> rows;
  for (const v1::SeqRange& range : ranges) {
    if (range.count() == 0) continue;
    rows.push_back({range.first_seq(), range.first_seq() + range.count() - 1});
  }
  return rows;
}

// "rows 101 to 200 and 301", "rows 1 to 5, 7, 9, 11, 13 and others".
std::string RowsText(const std::vector<VerifiedRows>& rows) {
  std::vector<std::string> parts;
  for (const VerifiedRows& range : rows) {
    if (parts.size() == kMaxNamedRanges) break;
    parts.push_back(range.first == range.last ? absl::StrCat(range.first)
                    : range.last == 0         ? absl::StrCat("those from ", range.first, " on")
                                              : absl::StrCat(range.first, " to ", range.last));
  }
  if (parts.empty()) return "rows";
  std::string last = parts.size() < rows.size() ? "others" : "";
  if (last.empty() && parts.size() > 1) {
    last = parts.back();
    parts.pop_back();
  }
  return absl::StrCat("rows ", absl::StrJoin(parts, ", "), last.empty() ? "" : " and ", last);
}

std::string StateOf(const v1::StreamAudit& audit) {
  if (audit.ended()) return audit.reported().end_is_unknown() ? "end not known" : "complete";
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

bool IsHeld(const v1::StreamAudit& audit) {
  return audit.holder() == v1::StreamAudit::HOLDER_CONNECTED ||
         audit.holder() == v1::StreamAudit::HOLDER_AWAY;
}

// What the agent may still have, by its own account.
uint64_t SpooledAtMost(const v1::StreamAudit& audit, uint64_t unstored) {
  if (audit.ended() || !IsHeld(audit)) return 0;
  return audit.has_reported() ? audit.reported().spooled_count() : unstored;
}

// Judges the streams of one session.
class Verifier {
 public:
  Verifier(const v1::GetSessionResponse& response, const v1::ListAgentsResponse& agents)
      : response_(response), session_(response.session()), agents_(agents) {}

  SessionVerification Verify() {
    result_.session_id = session_.id();
    for (const v1::StreamAudit& audit : response_.audit()) VerifyStream(audit);
    // First what is true of the whole session: it explains the rest.
    std::vector<VerificationProblem> problems = ProblemsOfSession();
    problems.insert(problems.end(), std::make_move_iterator(result_.problems.begin()),
                    std::make_move_iterator(result_.problems.end()));
    result_.problems = std::move(problems);
    return std::move(result_);
  }

 private:
  bool Is(v1::Session::State state) const { return session_.state() == state; }

  std::vector<VerificationProblem> ProblemsOfSession() const {
    std::vector<VerificationProblem> problems;
    const auto add = [&](std::string kind, std::string text, std::string what_to_do) {
      VerificationProblem& problem = problems.emplace_back();
      problem.kind = std::move(kind);
      problem.text = absl::StrCat("session ", session_.id(), " ", text);
      problem.what_to_do = std::move(what_to_do);
    };
    if (session_.has_observations_delete_time()) {
      add("deleted",
          absl::StrCat("has no observations any more: `rigcal session prune` or the server's "
                       "retention has deleted them at ",
                       FormatTime(true, session_.observations_delete_time())),
          "restore a backup that has them");
      return problems;
    }
    if (Is(v1::Session::STATE_CREATED)) {
      add("not_started", "has no streams yet: it has not been started",
          absl::StrCat("rigcal session start ", session_.id()));
      return problems;
    }
    if (Is(v1::Session::STATE_CAPTURING)) {
      add("capturing", "is still capturing",
          absl::StrCat("rigcal session stop ", session_.id(), " --wait, and verify it then"));
    } else if (Is(v1::Session::STATE_DRAINING)) {
      add("draining", "has been stopped, and its last observations are on their way",
          "verify it again when it has finished (rigcal session watch)");
    }
    std::set<std::string> with_streams;
    for (const VerifiedStream& stream : result_.streams) with_streams.insert(stream.camera);
    for (const v1::SessionCamera& camera : session_.cameras()) {
      const std::string& name = camera.description().camera();
      if (camera.conflict_count() > 0) {
        add("conflict",
            absl::StrCat("does not have ", FormatCount(camera.conflict_count(), "observation"),
                         " of camera ", name,
                         ": they came under numbers that were taken by others, with other values"),
            "see whether two agents use one state directory, or a copy of it");
        problems.back().camera = name;
        problems.back().count = camera.conflict_count();
      }
      if (with_streams.contains(name)) continue;
      add("no_stream",
          absl::StrCat(
              "has nothing of camera ", name, ": no capture of it began",
              camera.agent_id().empty() ? "" : absl::StrCat(" at ", AgentText(camera.agent_id()))),
          "record again where it is needed");
      problems.back().camera = name;
    }
    if (result_.streams.empty() && problems.empty()) {
      add("no_stream", "has no streams: nothing was captured in it", "record again");
    }
    return problems;
  }

  const v1::Agent* FindAgent(const std::string& id) const {
    const auto found = std::ranges::find_if(
        agents_.agents(), [&](const v1::Agent& agent) { return agent.agent_id() == id; });
    return found == agents_.agents().end() ? nullptr : &*found;
  }
  std::string AgentText(const std::string& id) const {
    const v1::Agent* const agent = FindAgent(id);
    return absl::StrCat(
        "agent ", id,
        agent == nullptr || agent->host().empty() ? "" : absl::StrCat(" on ", agent->host()));
  }
  // " (since 2026-01-31 23:59:59)"
  std::string SinceText(const std::string& id) const {
    const v1::Agent* const agent = FindAgent(id);
    if (agent == nullptr || !agent->has_disconnect_time()) return "";
    return absl::StrCat(" (since ", FormatTime(true, agent->disconnect_time()), ")");
  }
  std::string SpoolText(const std::string& id) const {
    const v1::Agent* const agent = FindAgent(id);
    const bool is_known = agent != nullptr && agent->has_spool();
    return absl::StrCat("the spool of ", AgentText(id),
                        !is_known ? ""
                        : agent->spool().folder().empty()
                            ? " (in its memory)"
                            : absl::StrCat(" (", agent->spool().folder(), ")"));
  }
  bool IsInMemory(const std::string& id) const {
    const v1::Agent* const agent = FindAgent(id);
    return agent != nullptr && agent->has_spool() && agent->spool().folder().empty();
  }

  VerificationProblem& Add(const VerifiedStream& stream, std::string kind, uint64_t count,
                           std::vector<VerifiedRows> rows, std::string where) {
    VerificationProblem& problem = result_.problems.emplace_back();
    problem.kind = std::move(kind);
    problem.camera = stream.camera;
    problem.stream_epoch = stream.stream_epoch;
    problem.count = count;
    problem.rows = std::move(rows);
    problem.where = std::move(where);
    problem.text = absl::StrCat("camera ", stream.camera, ", stream ", stream.stream_epoch, ": ");
    return problem;
  }

  void VerifyStream(const v1::StreamAudit& audit) {
    VerifiedStream stream;
    stream.camera = audit.camera();
    stream.stream_epoch = audit.stream_epoch();
    stream.state = StateOf(audit);
    stream.detected =
        std::max({audit.last_seq(), audit.reported().last_seq(), audit.highest_seq()});
    stream.durable = audit.stored_count();
    stream.late = audit.late_count();
    stream.damaged = audit.damaged_count();
    stream.dropped = CountsOf(audit.dropped());
    const uint64_t known = stream.durable + stream.damaged + stream.dropped_count();
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
    result_.streams.push_back(stream);
    // Of deleted rows nothing can be said.
    if (session_.has_observations_delete_time()) return;
    if (stream.damaged > 0) AddDamage(audit, stream);
    if (!audit.ended()) {
      AddOpenEnd(audit, stream);
    } else if (audit.reported().end_is_unknown()) {
      AddUnknownEnd(audit, stream);
    }
    if (stream.missing > 0) {
      VerificationProblem& problem =
          Add(stream, "missing", stream.missing, AbsentRows(audit, stream), "nowhere");
      absl::StrAppend(&problem.text, "detected ", stream.detected, ", but durable ", stream.durable,
                      " + damaged ", stream.damaged, " + spooled ", stream.spooled, " + dropped ",
                      stream.dropped_count(), ": ", stream.missing, " are missing, of ",
                      RowsText(problem.rows));
      problem.what_to_do =
          "restore a backup of the server that has them, or calibrate without them: the result "
          "says so";
    }
    if (surplus > 0) {
      VerificationProblem& problem = Add(stream, "surplus", surplus, {}, "the store");
      absl::StrAppend(&problem.text, "detected ", stream.detected, ", but durable ", stream.durable,
                      " + damaged ", stream.damaged, " + dropped ", stream.dropped_count(), ": ",
                      surplus, " too many");
      problem.what_to_do = "run `rigcal-server check` on the server";
    }
    if (audit.reported().acknowledged_seq() > audit.durable_seq()) {
      VerificationProblem& problem =
          Add(stream, "went_back", audit.reported().acknowledged_seq() - audit.durable_seq(),
              {{audit.durable_seq() + 1, audit.reported().acknowledged_seq()}}, "nowhere");
      absl::StrAppend(&problem.text, "the server had acknowledged all up to ",
                      audit.reported().acknowledged_seq(), ", and has them up to ",
                      audit.durable_seq());
      problem.what_to_do = "restore a newer backup of the server, where there is one";
    }
  }

  void AddDamage(const v1::StreamAudit& audit, const VerifiedStream& stream) {
    VerificationProblem& problem =
        Add(stream, "damaged", stream.damaged, RowsOf(audit.damaged()), "the store");
    absl::StrAppend(&problem.text, RowsText(problem.rows), " (", stream.damaged,
                    ") are damaged in the server's database and cannot be read: ", audit.damage());
    problem.what_to_do =
        "restore a backup that has them (rigcal-server restore), or calibrate without them: the "
        "result says so";
  }

  // What is neither stored nor damaged nor dropped.
  std::vector<VerifiedRows> AbsentRows(const v1::StreamAudit& audit,
                                       const VerifiedStream& stream) const {
    std::vector<VerifiedRows> rows = RowsOf(audit.absent());
    if (stream.detected > audit.highest_seq()) {
      const auto last = static_cast<uint32_t>(stream.detected);
      if (!rows.empty() && rows.back().last == audit.highest_seq()) {
        rows.back().last = last;
      } else {
        rows.push_back({audit.highest_seq() + 1, last});
      }
    }
    return rows;
  }

  // All that its agent had was delivered, but the agent itself does not know whether it had all.
  void AddUnknownEnd(const v1::StreamAudit& audit, const VerifiedStream& stream) {
    const auto detected = static_cast<uint32_t>(stream.detected);
    VerificationProblem& problem = Add(stream, "end_unknown", 0, {{detected + 1, 0}}, "nowhere");
    absl::StrAppend(&problem.text, "what was detected after row ", detected,
                    " is not known: ", AgentText(audit.agent_id()),
                    " ended while it captured, by a power cut or with files of its spool damaged "
                    "or gone, and nothing it found shows which row was the last");
    problem.what_to_do =
        "calibrate without it (the result says so), or record again where it is needed";
  }

  // Nothing says yet which observation is the last one.
  void AddOpenEnd(const v1::StreamAudit& audit, const VerifiedStream& stream) {
    std::vector<VerifiedRows> rows = AbsentRows(audit, stream);
    const std::string spooled =
        stream.spooled == 0 ? "" : absl::StrCat(RowsText(rows), " (", stream.spooled, ")");
    // Where the end was announced nothing comes behind it.
    const bool is_open = audit.last_seq() == 0;
    if (is_open) rows.push_back({static_cast<uint32_t>(stream.detected) + 1, 0});
    const std::string behind =
        is_open ? absl::StrCat("what was detected after row ", stream.detected) : "";
    const std::string& agent = audit.agent_id();
    const auto what = [&] {
      return absl::StrCat(spooled, spooled.empty() || behind.empty() ? "" : ", and ", behind);
    };
    switch (audit.holder()) {
      case v1::StreamAudit::HOLDER_CONNECTED: {
        VerificationProblem& problem =
            Add(stream, "waiting", stream.spooled, std::move(rows), SpoolText(agent));
        if (spooled.empty()) {
          absl::StrAppend(&problem.text, "its end has not come yet from ", AgentText(agent));
        } else {
          absl::StrAppend(&problem.text, spooled, " wait in ", problem.where,
                          is_open ? ", and its end has not come yet" : "");
        }
        problem.what_to_do = Is(v1::Session::STATE_CAPTURING)
                                 ? "stop the session, and verify it then"
                                 : "verify again when the agent has delivered them (rigcal agent "
                                   "list shows its spool)";
        return;
      }
      case v1::StreamAudit::HOLDER_AWAY: {
        VerificationProblem& problem =
            Add(stream, "away", stream.spooled, std::move(rows), SpoolText(agent));
        absl::StrAppend(&problem.text, AgentText(agent), " is not connected", SinceText(agent),
                        " and has not delivered it to its end: ", what(),
                        IsInMemory(agent) ? " is lost if the agent has ended: " : " may be in ",
                        IsInMemory(agent) ? "its spool is in memory" : problem.where);
        problem.what_to_do = absl::StrCat("start agent ", agent, " again, and verify then");
        return;
      }
      case v1::StreamAudit::HOLDER_GONE: {
        VerificationProblem& problem = Add(stream, "gone", 0, std::move(rows), "nowhere");
        absl::StrAppend(&problem.text, AgentText(agent),
                        " does not have the stream any more, and its end never came: ",
                        is_open ? behind : "what is missing", " is not known");
        problem.what_to_do =
            "start the agent with the state directory that it had, where there is one";
        return;
      }
      default: {
        VerificationProblem& problem = Add(stream, "no_agent", 0, std::move(rows), "not known");
        absl::StrAppend(&problem.text, "no agent delivers it, and its end has not come: ",
                        is_open ? behind : "what is missing", " is not known");
        problem.what_to_do = "who uploads it must send end_of_capture (UploadBatch)";
      }
    }
  }

  const v1::GetSessionResponse& response_;
  const v1::Session& session_;
  const v1::ListAgentsResponse& agents_;
  SessionVerification result_;
};

VerifiedStream SumOf(const SessionVerification& verification) {
  VerifiedStream sum;
  for (const VerifiedStream& stream : verification.streams) {
    sum.detected += stream.detected;
    sum.durable += stream.durable;
    sum.late += stream.late;
    sum.damaged += stream.damaged;
    sum.spooled += stream.spooled;
    sum.missing += stream.missing;
    for (const auto& [reason, count] : stream.dropped) sum.dropped[reason] += count;
  }
  return sum;
}

}  // namespace

SessionVerification VerifySession(const v1::GetSessionResponse& response,
                                  const v1::ListAgentsResponse& agents) {
  return Verifier(response, agents).Verify();
}

std::string FormatVerification(const SessionVerification& verification) {
  TextTable table;
  table.Words({"camera"})
      .Numbers({"stream", "detected", "durable", "damaged", "spooled", "dropped", "missing"})
      .Words({"where it is", "dropped because"});
  for (const VerifiedStream& stream : verification.streams) {
    table.AddRow(
        {stream.camera, stream.stream_epoch, stream.detected, stream.durable, stream.damaged,
         stream.spooled, stream.dropped_count(), stream.missing, stream.state,
         stream.dropped.empty() ? "-"
                                : absl::StrJoin(stream.dropped, ", ", absl::PairFormatter(" "))});
  }
  std::string text = table.empty() ? "" : table.Format() + "\n";
  const VerifiedStream sum = SumOf(verification);
  if (sum.late > 0) {
    absl::StrAppend(&text, sum.late,
                    " of the durable ones came after the session had finished: no calibration "
                    "uses them; `rigcal session stop --drain-timeout SECONDS` waits longer\n");
  }
  if (verification.holds()) {
    return absl::StrCat(text, "verified: ", sum.detected, " detected = ", sum.durable,
                        " durable and readable + 0 damaged + 0 spooled + ", sum.dropped_count(),
                        " dropped\n");
  }
  for (const VerificationProblem& problem : verification.problems) {
    absl::StrAppend(&text, "not verified: ", Printable(problem.text),
                    problem.what_to_do.empty() ? "" : "; ", Printable(problem.what_to_do), "\n");
  }
  return text;
}

std::string VerificationJson(const SessionVerification& verification) {
  using Json = nlohmann::ordered_json;
  const auto counts = [](const VerifiedStream& stream) {
    return Json{{"detected", stream.detected}, {"durable", stream.durable},
                {"late", stream.late},         {"damaged", stream.damaged},
                {"spooled", stream.spooled},   {"dropped", Json(stream.dropped)},
                {"missing", stream.missing}};
  };
  Json streams = Json::array();
  for (const VerifiedStream& stream : verification.streams) {
    Json& added = streams.emplace_back(Json{
        {"camera", stream.camera}, {"stream_epoch", stream.stream_epoch}, {"state", stream.state}});
    added.update(counts(stream));
  }
  Json problems = Json::array();
  for (const VerificationProblem& problem : verification.problems) {
    Json rows = Json::array();
    for (const VerifiedRows& range : problem.rows) {
      rows.push_back(
          {{"first", range.first}, {"last", range.last == 0 ? Json() : Json(range.last)}});
    }
    problems.push_back({{"kind", problem.kind},
                        {"camera", problem.camera},
                        {"stream_epoch", problem.stream_epoch},
                        {"count", problem.count},
                        {"rows", std::move(rows)},
                        {"where", problem.where},
                        {"text", problem.text},
                        {"what_to_do", problem.what_to_do}});
  }
  return JsonText(Json{{"session", verification.session_id},
                       {"holds", verification.holds()},
                       {"sum", counts(SumOf(verification))},
                       {"streams", std::move(streams)},
                       {"problems", std::move(problems)}});
}

}  // namespace rigcal::client
