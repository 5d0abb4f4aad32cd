// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>

#include "tests/testing/postgres_cluster.h"

namespace rigcal::testing {

// Counts the ends of calibrations in the database itself, whoever stores them. Once the tables are
// there.
class PublishedCalibrations {
 public:
  PublishedCalibrations(const PostgresCluster* cluster, std::string database)
      : cluster_(*cluster), database_(std::move(database)) {
    cluster_.Sql(database_, R"sql(
CREATE SCHEMA watch;
CREATE TABLE watch.ended(number BIGINT, state BIGINT);
CREATE FUNCTION watch.note() RETURNS trigger LANGUAGE plpgsql AS
  'BEGIN INSERT INTO watch.ended VALUES(NEW.number, NEW.state); RETURN NULL; END';
CREATE TRIGGER note AFTER UPDATE ON public.calibration FOR EACH ROW WHEN (NEW.state > 2)
  EXECUTE FUNCTION watch.note();
)sql");
  }
  // Every calibration that has ended was stored so once.
  void ExpectEachOnce() const {
    EXPECT_EQ(cluster_.Sql(database_,
                           "SELECT number, count(*) FROM watch.ended GROUP BY number HAVING "
                           "count(*) <> 1"),
              "");
    EXPECT_EQ(cluster_.Sql(database_, "SELECT count(*) FROM public.calibration WHERE state > 2"),
              cluster_.Sql(database_, "SELECT count(*) FROM watch.ended"));
  }

 private:
  const PostgresCluster& cluster_;
  const std::string database_;
};

}  // namespace rigcal::testing
