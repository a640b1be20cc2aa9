-- Of a service of several processes, which divides its tenants into shards: the processes that are there or were, which of them has which shard, and in which shard each tenant is.
CREATE TABLE processes (
    number integer PRIMARY KEY,
    address text NOT NULL,
    is_ending boolean NOT NULL DEFAULT false
);

-- Shard 0 is this schema's; `told` once it was served, and the tenants that it had before are in the table below.
CREATE TABLE shards (
    number integer PRIMARY KEY,
    holder integer,
    told boolean NOT NULL DEFAULT false
);

-- Where a tenant is, which never changes.
CREATE TABLE tenants (
    tenant text COLLATE "C" PRIMARY KEY,
    shard integer NOT NULL
);
