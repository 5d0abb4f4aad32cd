// SPDX-License-Identifier: Apache-2.0
#include "common/enrolment/renewal_thread.h"

#include <exception>
#include <optional>
#include <utility>

#include "common/enrolment/connection_refusal.h"
#include "common/enrolment/join_server.h"
#include "common/status/guarded.h"
#include "common/status/status_macros.h"

namespace rigcal {
namespace {

// The server's clock counts, and that of this PC may be wrong: so the server is asked once in a
// while even if nothing seems to be due.
constexpr std::chrono::hours kAskEvery{24};

constexpr std::chrono::milliseconds kTimeout{3000};  // the program may want to end

// True: the folder has a new certificate.
absl::StatusOr<bool> RenewWhereDue(const IdentityFolder& folder, bool ask_anyway) {
  RIGCAL_ASSIGN_OR_RETURN(const PeerIdentity identity, folder.Load());
  const bool is_due = IsRenewalDue(identity);
  if (!ask_anyway && !is_due) return false;
  const absl::StatusOr<std::optional<PeerIdentity>> answer = RenewIdentity(identity, kTimeout);
  if (absl::IsUnavailable(answer.status())) {
    // It may not say why it refuses, and still show that it does.
    if (ask_anyway) RIGCAL_RETURN_IF_ERROR(TryHandshakes(identity, kTimeout));
    if (!is_due) return false;  // there is time
  }
  RIGCAL_ASSIGN_OR_RETURN(const std::optional<PeerIdentity> renewed, answer);
  folder.NoteAsked();
  if (!renewed) return false;
  RIGCAL_RETURN_IF_ERROR(folder.Renew(*renewed));
  return true;
}

}  // namespace

RenewalThread::RenewalThread(IdentityFolder folder, Events events,
                             std::chrono::milliseconds interval,
                             std::chrono::milliseconds ask_again)
    : folder_(std::move(folder)),
      events_(std::move(events)),
      interval_(interval),
      ask_again_(ask_again) {}

void RenewalThread::Start() {
  thread_ = std::thread([this] { Run(); });
}

void RenewalThread::Shutdown() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void RenewalThread::AskSoon() {
  const std::lock_guard lock(mutex_);
  ask_ = true;
  changed_.notify_all();
}

void RenewalThread::Run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    const auto now = std::chrono::steady_clock::now();
    const bool ask_anyway = std::exchange(ask_, false) || now >= asked_ + kAskEvery;
    if (ask_anyway) asked_ = now;
    lock.unlock();
    const absl::Status status = Guarded("renewing the certificate", [&] { RenewOnce(ask_anyway); });
    // It is tried again after the interval.
    if (!status.ok()) {
      Guarded("telling of it", [&] {
        events_.trouble(std::string(status.message()));
      }).IgnoreError();
    }
    lock.lock();
    changed_.wait_for(lock, interval_, [this] { return stopping_ || ask_; });
    // What is asked for too soon is not forgotten, only later.
    changed_.wait_until(lock, asked_ + ask_again_, [this] { return stopping_ || !ask_; });
  }
}

void RenewalThread::RenewOnce(bool ask_anyway) {
  absl::StatusOr<bool> renewed = false;
  try {
    renewed = RenewWhereDue(folder_, ask_anyway);
  } catch (const std::exception& error) {
    renewed = absl::InternalError(error.what());
  }
  const std::string trouble(renewed.status().message());
  if (renewed.ok() && *renewed) events_.renewed();
  if (!renewed.ok() && trouble != last_trouble_) events_.trouble(trouble);
  if (ask_anyway || !renewed.ok()) last_trouble_ = trouble;
}

}  // namespace rigcal
