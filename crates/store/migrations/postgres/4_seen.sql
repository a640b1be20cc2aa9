-- When the process that has the database was last well: one that stands still or is cut off loses it to who waits.
ALTER TABLE catalogue ADD COLUMN seen timestamptz NOT NULL DEFAULT now();
