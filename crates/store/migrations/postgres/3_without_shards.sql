-- Version 2 had tables of processes that divided the tenants among them.
DROP TABLE IF EXISTS processes, shards, tenants;
