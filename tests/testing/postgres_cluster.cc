// SPDX-License-Identifier: Apache-2.0
#include "tests/testing/postgres_cluster.h"

#include <gtest/gtest.h>
#include <pwd.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"

namespace rigcal::testing {
namespace {

namespace fs = std::filesystem;

// Debian keeps the programs of the server beside each other by version, not in PATH.
fs::path ProgramFolder() {
  std::vector<fs::path> folders;
  std::error_code error;
  for (fs::directory_iterator entry("/usr/lib/postgresql", error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path folder = entry->path() / "bin";
    if (fs::exists(folder / "initdb") && fs::exists(folder / "postgres")) folders.push_back(folder);
  }
  return folders.empty() ? fs::path() : *std::max_element(folders.begin(), folders.end());
}

const passwd* PostgresUser() { return geteuid() == 0 ? getpwnam("postgres") : nullptr; }

// A program of PostgreSQL as a user who is not root.
std::vector<std::string> Command(const std::string& program,
                                 const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {"/usr/bin/setpriv", "--pdeathsig", "QUIT"};
  if (PostgresUser() != nullptr) {
    for (const char* option : {"--reuid=postgres", "--regid=postgres", "--clear-groups"}) {
      command.emplace_back(option);
    }
  }
  command.push_back((ProgramFolder() / program).string());
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

void Must(const std::string& program, const std::vector<std::string>& arguments) {
  const CommandResult result = RunCommand(Command(program, arguments));
  ASSERT_EQ(result.exit_code, 0) << program << ": " << result.output << result.error;
}

}  // namespace

bool PostgresCluster::Installed() {
  return !ProgramFolder().empty() && fs::exists("/usr/bin/setpriv") &&
         (geteuid() != 0 || PostgresUser() != nullptr);
}

PostgresCluster& PostgresCluster::Shared() {
  static PostgresCluster cluster({.fsync = false});
  return cluster;
}

PostgresCluster::PostgresCluster(Options options) {
  Initialize(options);
  Start();
}

void PostgresCluster::Initialize(const Options& options) {
  if (const passwd* user = PostgresUser()) {
    ASSERT_EQ(chown(directory_.path().c_str(), user->pw_uid, user->pw_gid), 0);
  }
  Must("initdb", {"-D", data().string(), "-U", "rigcal", "-E", "UTF8", "--locale=C.UTF-8",
                  "--auth=trust", "--no-sync"});
  Set(absl::StrCat("fsync=", options.fsync ? "on" : "off"));
  for (const char* setting :
       {"listen_addresses=''", "shared_buffers=16MB", "max_connections=20", "autovacuum=off"}) {
    Set(setting);
  }
  for (const std::string& setting : options.settings) Set(setting);
  if (options.hba.empty()) return;
  std::ofstream hba(data() / "pg_hba.conf");
  for (const std::string& line : options.hba) hba << line << "\n";
  hba << "local all all trust\nlocal replication all trust\n";
}

PostgresCluster::~PostgresCluster() { StopAtOnce(); }

void PostgresCluster::Start() {
  const auto answers = [this] {
    // After Kill it ends at once while a process of the one before is left.
    if (server_ == nullptr || !server_->Running()) {
      server_ = std::make_unique<Process>(Process::Options{
          .arguments =
              Command("postgres", {"-D", data().string(), "-k", directory_.path().string()}),
          .environment = {}});
    }
    return RunCommand(Command("pg_isready", {"-q", "-h", directory_.path().string()})).exit_code ==
           0;
  };
  ASSERT_TRUE(WaitFor(answers)) << server_->StandardError();
}

void PostgresCluster::StopAtOnce() {
  if (server_ == nullptr) return;
  server_->Signal(SIGQUIT);
  server_->Wait();
  server_.reset();
}

void PostgresCluster::Kill() {
  server_->Signal(SIGKILL);
  server_->Wait();
  server_.reset();
}

void PostgresCluster::Stop() {
  server_->Signal(SIGINT);
  server_->Wait();
  server_.reset();
}

void PostgresCluster::Set(const std::string& setting) {
  std::ofstream(data() / "postgresql.conf", std::ios::app) << setting << "\n";
}

std::string PostgresCluster::Url(const std::string& database, const std::string& user) const {
  std::string folder;  // "/" within a host of an address is %2F
  for (const char letter : directory_.path().string()) {
    folder += letter == '/' ? std::string("%2F") : std::string(1, letter);
  }
  return absl::StrCat("postgresql://", user, "@", folder, "/", database);
}

void PostgresCluster::CreateTablespace(const std::string& name, const fs::path& folder) {
  if (const passwd* user = PostgresUser()) {
    ASSERT_EQ(chown(folder.c_str(), user->pw_uid, user->pw_gid), 0);
  }
  Sql("postgres", absl::StrCat("CREATE TABLESPACE ", name, " LOCATION '", folder.string(), "'"));
}

std::string PostgresCluster::CreateDatabase(const std::string& tablespace) {
  const std::string name = absl::StrCat("test_", ++database_count_);
  Sql("postgres",
      absl::StrCat("CREATE DATABASE ", name, tablespace.empty() ? "" : " TABLESPACE ", tablespace));
  return name;
}

std::string PostgresCluster::NewUrl() {
  const std::string name = absl::StrCat("schema_", ++schema_count_);
  Sql("postgres", absl::StrCat("CREATE SCHEMA ", name));
  return absl::StrCat(Url("postgres"), "?options=-csearch_path%3D", name);
}

std::string PostgresCluster::Sql(const std::string& database, const std::string& statements) const {
  const CommandResult result = RunCommand(Command(
      "psql", {"-X", "-q", "-A", "-t", "-v", "ON_ERROR_STOP=1", "-h", directory_.path().string(),
               "-U", "rigcal", "-d", database, "-c", statements}));
  EXPECT_EQ(result.exit_code, 0) << statements << ": " << result.error;
  std::string output = result.output;
  absl::StripTrailingAsciiWhitespace(&output);
  return output;
}

std::unique_ptr<PostgresCluster> PostgresCluster::MakeStandby() {
  std::unique_ptr<PostgresCluster> standby(new PostgresCluster());
  if (const passwd* user = PostgresUser()) {
    EXPECT_EQ(chown(standby->directory_.path().c_str(), user->pw_uid, user->pw_gid), 0);
  }
  Must("pg_basebackup", {"-D", standby->data().string(), "-h", directory_.path().string(), "-U",
                         "rigcal", "-R", "-c", "fast", "--no-sync"});
  return standby;
}

void PostgresCluster::Promote() { Sql("postgres", "SELECT pg_promote()"); }

}  // namespace rigcal::testing
