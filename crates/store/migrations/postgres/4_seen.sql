-- When the process that has the database was last well: one that stands still or is cut off loses it to who waits. Earlier versions do not say, and keep it.
ALTER TABLE catalogue ADD COLUMN seen timestamptz;
