// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "client/commands/command_context.h"
#include "client/net/paging.h"
#include "common/target/target.h"

namespace rigcal::client {

struct SessionCreateOptions {
  std::string id;   // empty: the server makes one
  std::string rig;  // empty: "rig"
  std::string title;
  Target target;
  std::vector<std::string> cameras;  // empty: all that are connected at the start
  bool start = false;                // at once
  double until_mm = 0;               // 0: it has no goal
  double min_s = -1;                 // of the goal; below 0: the server's own (20 s)
  std::string continues;             // id of a finished session; empty: none
};

struct SessionStopOptions {
  std::string id;
  double drain_timeout_s = 0;  // 0: the server's own (10 s)
  bool wait = false;           // until the session is finished
};

// `rigcal session ...`. Each prints the session (list: all of them) and returns the exit code.
ExitCode CreateSession(const SessionCreateOptions& options, CommandContext& context);
ExitCode StartSession(const std::string& id, CommandContext& context);
ExitCode StopSession(const SessionStopOptions& options, CommandContext& context);
ExitCode ListSessions(const ListOptions& options, CommandContext& context);
struct SessionGetOptions {
  std::string id;
  bool all = false;  // every camera, however many there are
};
ExitCode GetSession(const SessionGetOptions& options, CommandContext& context);
struct SessionDeleteOptions {
  std::string id;
  bool yes = false;  // without asking
};
ExitCode DeleteSession(const SessionDeleteOptions& options, CommandContext& context);

struct SessionDiscardOptions {
  std::string id;
  bool undo = false;
};
ExitCode DiscardSession(const SessionDiscardOptions& options, CommandContext& context);

struct SessionPruneOptions {
  double older_than_days = 0;  // 0: no limit by age
  double max_mib = 0;          // 0: no limit by size
  std::string rig;             // empty: all
  bool include_calibrated = false;
  bool dry_run = false;
};
// Deletes the observations of old sessions, or says which.
ExitCode PruneSessions(const SessionPruneOptions& options, CommandContext& context);

struct SessionResumeOptions {
  std::string id;
  double until_mm = 0;  // 0: the new session has no goal
};
// Starts a new session that goes on with this one: same rig, target and cameras.
ExitCode ResumeSession(const SessionResumeOptions& options, CommandContext& context);
// A line (as JSON: one object per line) now and after each change, until the session is finished or
// nobody reads any more.
ExitCode WatchSession(const std::string& id, CommandContext& context);

// Reads every stored row of the session at the server, and prints for every stream where its
// observations are: detected = durable and readable + damaged + spooled + dropped. kNotVerified
// where that does not hold, something is damaged, or a stream has not ended; which rows, where they
// are and what to do is said.
ExitCode VerifySessionStreams(const std::string& id, CommandContext& context);

struct SessionObservationsOptions {
  std::string session;
  std::string camera;  // empty: all
  bool include_late = false;
  std::string output;  // folder for a recorded rig; empty: CSV or JSON on stdout
  bool force = false;  // replace files that are there
};

// Writes what is stored of a session as CSV, in the order (camera, stream_epoch, seq): a head line,
// then `camera,stream_epoch,seq,clock_epoch,time_ns` and x, y (pixels, as many digits as it takes
// to read the same float again) of each marker; both empty for a marker that is not visible. As
// JSON: one ObservationBatch per line. With `output`: files as `rigcal local --data` reads them.
ExitCode WriteSessionObservations(const SessionObservationsOptions& options,
                                  CommandContext& context);

}  // namespace rigcal::client
