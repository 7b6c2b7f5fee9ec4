-- Bounds on lists, on the records of jobs, and on keys that keys make; see SQLite's migration 22.
CREATE INDEX jobs_by_kind ON jobs (tenant, kind, sequence);
CREATE INDEX jobs_by_priority ON jobs (tenant, priority, sequence);
CREATE INDEX jobs_by_filing ON jobs (tenant, created_at, sequence);
CREATE INDEX api_keys_by_tenant ON api_keys (tenant, sequence);
CREATE INDEX intake_groups_by_tenant_and_state ON intake_groups (tenant, state, sequence);
DROP INDEX audit_by_object;
CREATE INDEX audit_by_object ON audit (tenant, object, sequence);
CREATE INDEX audit_by_agent ON audit (tenant, agent, sequence);
CREATE INDEX audit_by_tenant_and_time ON audit (tenant, recorded, sequence);

DROP INDEX jobs_with_needs;
CREATE INDEX jobs_with_needs ON jobs (tenant, state) WHERE needs != '{}';

ALTER TABLE jobs ADD COLUMN bytes BIGINT GENERATED ALWAYS AS
    (2048 + octet_length(parameters) + octet_length(needs) + octet_length(labels)
     + octet_length(coalesce(external_id, '')) + octet_length(coalesce(webhook, ''))
     + octet_length(coalesce(source, '')) + octet_length(coalesce(send, ''))) STORED;
CREATE INDEX jobs_by_size ON jobs (tenant, bytes);

ALTER TABLE api_keys ADD COLUMN maker TEXT COLLATE "C";
