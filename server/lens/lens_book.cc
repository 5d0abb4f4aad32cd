// SPDX-License-Identifier: Apache-2.0
#include "server/lens/lens_book.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <optional>

#include "absl/strings/str_cat.h"
#include "common/board/board.h"
#include "common/lens/next_view.h"
#include "common/lens/view_coverage.h"
#include "common/status/status_macros.h"

namespace rigcal::server {
namespace {

std::string TooFewViews(const SessionViews& seen) {
  if (seen.observation_count == 0) return "nothing has been recorded with this camera yet";
  if (seen.board_count == 0) {
    return absl::StrCat(
        "the board is in none of the ", seen.observation_count,
        " pictures: hold it before this camera, sharp and not too far away, with its white margin; "
        "are its kind, counts and sides those of the session's target?");
  }
  return absl::StrCat("there are ", seen.views.size(), seen.views.size() == 1 ? " view" : " views",
                      " that differ, and a lens needs ", kLeastLensViews,
                      " at least, 20 to 40 are good: move the board all over the image, near, and "
                      "tilt it to every side");
}

// Of the views that the lens is made from, where there is one.
NextView NextViewOf(const Session& session, const SessionCamera& camera, const SessionLens& lens) {
  const absl::StatusOr<Board> board = ParseBoard(session.target.board);
  if (!board.ok()) return {};
  return AdviseNextView(board->OneSide().Points(), camera.description.image_size_px,
                        lens.seen.views, lens.solution ? &*lens.solution : nullptr,
                        !board->HasMarkers());
}

}  // namespace

LensBook::LensBook(const Store* store, LensBookOptions options)
    : store_(*store), options_(options) {
  tasks_.Start();
  // Of this thread alone, on Linux.
  tasks_.Post([this] { setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), options_.nice); });
}

absl::StatusOr<LensBook::Entry*> LensBook::FindOrAdd(const Key& key) {
  const auto found = entries_.find(key);
  if (found != entries_.end()) return &found->second;
  if (entries_.size() >= options_.most_lenses) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (entry->second.busy) continue;
      if (oldest == entries_.end() || entry->second.last_asked < oldest->second.last_asked) {
        oldest = entry;
      }
    }
    if (oldest == entries_.end()) {
      return absl::ResourceExhaustedError(absl::StrCat(
          "lenses of ", entries_.size(), " cameras are being made; ask again in a minute"));
    }
    entries_.erase(oldest);
  }
  return &entries_[key];
}

absl::StatusOr<LensBook::Answer> LensBook::Get(const std::string& session_id,
                                               const std::string& camera) {
  Answer answer;
  RIGCAL_ASSIGN_OR_RETURN(answer.session, store_.GetSession(session_id));
  RIGCAL_ASSIGN_OR_RETURN(const SessionCamera* const found, FindLensCamera(answer.session, camera));
  answer.camera = found->description;
  RIGCAL_ASSIGN_OR_RETURN(const auto counts, store_.GetSessionCounts(session_id));
  for (const SessionCameraCounts& of_camera : counts) {
    if (of_camera.camera != camera) continue;
    answer.stored_count = of_camera.observation_count - of_camera.late_count;
  }
  const Key key(session_id, camera);
  const std::lock_guard lock(mutex_);
  RIGCAL_ASSIGN_OR_RETURN(Entry* const entry, FindOrAdd(key));
  const Clock::time_point now = Clock::now();
  entry->last_asked = now;
  const bool is_old = !entry->begun || entry->asked_count != answer.stored_count;
  if (is_old && !entry->busy && now >= entry->rest_until) {
    entry->begun = entry->busy = true;
    entry->asked_count = answer.stored_count;
    tasks_.Post([this, key, session = answer.session, seen_by = *found,
                 stored_count = answer.stored_count] {
      const Clock::time_point start = Clock::now();
      Make(key, session, seen_by, stored_count);
      const auto rest =
          std::chrono::duration_cast<Clock::duration>(options_.rest_ratio * (Clock::now() - start));
      const std::lock_guard end_lock(mutex_);
      Entry& made = entries_.at(key);
      made.busy = false;
      made.rest_until = Clock::now() + std::max<Clock::duration>(rest, options_.shortest_rest);
    });
  }
  answer.lens = entry->lens;
  return answer;
}

void LensBook::Publish(const Key& key, SessionLens lens) {
  const std::lock_guard lock(mutex_);
  entries_.at(key).lens = std::make_shared<const SessionLens>(std::move(lens));
}

void LensBook::Make(const Key& key, const Session& session, const SessionCamera& camera,
                    uint64_t stored_count) {
  SessionLens lens;
  {
    const std::lock_guard lock(mutex_);
    // Who watches goes on seeing the last lens while the next one is made.
    const SessionLens& last = *entries_.at(key).lens;
    lens.solution = last.solution;
    lens.solution_times_ns = last.solution_times_ns;
    lens.solution_observation_count = last.solution_observation_count;
    lens.next_view = last.next_view;
  }
  const ImageSize& image_size_px = camera.description.image_size_px;
  absl::StatusOr<SessionViews> seen = ReadSessionViews(store_, session, camera);
  if (!seen.ok()) {
    lens = {};
    lens.state = SessionLens::State::kFailed;
    lens.problem = std::string(seen.status().message());
    return Publish(key, std::move(lens));
  }
  lens.seen = *std::move(seen);
  // What is damaged has been read as far as it can be.
  lens.seen.observation_count = std::max(lens.seen.observation_count, stored_count);
  lens.covered_share = CoveredShare(lens.seen.views, image_size_px);
  lens.bare_sides = BareSides(lens.seen.views, image_size_px);
  if (lens.seen.views.size() < kLeastLensViews) {
    lens.state = SessionLens::State::kCollecting;
    lens.problem = TooFewViews(lens.seen);
    lens.solution.reset();
    lens.next_view = NextViewOf(session, camera, lens);
    return Publish(key, std::move(lens));
  }
  lens.state = lens.solution ? SessionLens::State::kSolved : SessionLens::State::kSolving;
  Publish(key, lens);
  absl::StatusOr<LensSolution> solution = SolveLens(lens.seen.views, image_size_px);
  lens.solution_times_ns.clear();
  lens.solution_observation_count = lens.seen.observation_count;
  if (solution.ok()) {
    lens.state = SessionLens::State::kSolved;
    lens.solution = *std::move(solution);
    for (const BoardView& view : lens.seen.views) lens.solution_times_ns.push_back(view.time_ns);
  } else {
    lens.state = SessionLens::State::kFailed;
    lens.problem = std::string(solution.status().message());
    lens.solution.reset();
  }
  lens.next_view = NextViewOf(session, camera, lens);
  Publish(key, std::move(lens));
}

}  // namespace rigcal::server
