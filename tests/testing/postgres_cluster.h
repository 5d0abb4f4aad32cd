// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tests/testing/process.h"
#include "tests/testing/temporary_directory.h"

namespace rigcal::testing {

// A PostgreSQL server of its own in a temporary folder, reached over a Unix socket only. Ends with
// the object, and with this process however that ends. Runs as the user postgres where the test is
// root, as PostgreSQL refuses to be root. Check Installed first.
class PostgresCluster {
 public:
  struct Options {
    bool fsync = true;                       // false: faster, for tests that lose no power
    std::vector<std::string> settings = {};  // "max_connections=10"
    std::vector<std::string> hba = {};       // lines of pg_hba.conf, before the one that trusts all
  };

  // PostgreSQL's server is on this PC.
  static bool Installed();
  // One for all tests of a program, with fsync off.
  static PostgresCluster& Shared();

  explicit PostgresCluster(Options options);
  ~PostgresCluster();

  // Its superuser is `rigcal`.
  std::string Url(const std::string& database, const std::string& user = "rigcal") const;
  // A new empty database; its name. `tablespace`: where its files are; empty: beside the others.
  std::string CreateDatabase(const std::string& tablespace = "");
  // Gives a folder to the user as whom it runs, and makes a tablespace of it.
  void CreateTablespace(const std::string& name, const std::filesystem::path& folder);
  // The address of a new empty schema, which is as good as a database of its own and made faster.
  std::string NewUrl();
  // Runs statements; what they give, a row per line, values between `|`. Fails the test on errors.
  std::string Sql(const std::string& database, const std::string& statements) const;

  // Ends as in a crash: nothing is written any more.
  void StopAtOnce();
  // kill -9 of its first process. The others end a moment later.
  void Kill();
  // Waits for nothing but open transactions' rollback.
  void Stop();
  // After a stop. Waits until it answers.
  void Start();
  // A line more in postgresql.conf, in effect from the next start.
  void Set(const std::string& setting);
  const std::filesystem::path& socket_folder() const { return directory_.path(); }
  // A standby of this one in `copy`, which was not started: a base backup, and where to read from.
  std::unique_ptr<PostgresCluster> MakeStandby();
  // Ends the standby's recovery.
  void Promote();

 private:
  PostgresCluster() = default;
  std::filesystem::path data() const { return directory_.path() / "data"; }
  void Initialize(const Options& options);

  TemporaryDirectory directory_;
  std::unique_ptr<Process> server_;
  int database_count_ = 0;
  int schema_count_ = 0;
};

}  // namespace rigcal::testing
