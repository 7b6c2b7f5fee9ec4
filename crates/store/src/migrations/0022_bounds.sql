-- Every filter of a list has an index that begins with the tenant and ends with the order of the list, so that no
-- page reads more rows than one of its filters lets through (store/tables/pages.rs).
CREATE INDEX jobs_by_kind ON jobs (tenant, kind, sequence);
CREATE INDEX jobs_by_priority ON jobs (tenant, priority, sequence);
CREATE INDEX jobs_by_filing ON jobs (tenant, created_at, sequence);
CREATE INDEX api_keys_by_tenant ON api_keys (tenant, sequence);
CREATE INDEX intake_groups_by_tenant_and_state ON intake_groups (tenant, state, sequence);
DROP INDEX audit_by_object;
CREATE INDEX audit_by_object ON audit (tenant, object, sequence);
CREATE INDEX audit_by_agent ON audit (tenant, agent, sequence);
CREATE INDEX audit_by_tenant_and_time ON audit (tenant, recorded, sequence);

-- An erasure looks for the jobs that need an item among those of its tenant.
DROP INDEX jobs_with_needs;
CREATE INDEX jobs_with_needs ON jobs (tenant, state) WHERE needs != '{}';

-- What PostgreSQL has from the beginning: whether an id was erased, and the row of a received file.
CREATE INDEX erased_by_id ON erased (id);
CREATE INDEX intake_objects_by_file ON intake_objects (file) WHERE file IS NOT NULL;

-- The destinations of errands are jumped through by `deliveries_due` and `sends_due`, which are not used while there is
-- an index that begins with the state.
DROP INDEX deliveries_by_state;
CREATE INDEX deliveries_dead ON deliveries (sequence) WHERE state = 'dead';
DROP INDEX sends_by_state;
CREATE INDEX sends_dead ON sends (sequence) WHERE state = 'dead';

-- The record of a job counts against its tenant's quota until it is erased: the texts that it was filed with, and 2 KiB
-- for the other columns, the indexes, and what is told and sent of it. So it does not grow while the job runs.
ALTER TABLE jobs ADD COLUMN bytes INTEGER GENERATED ALWAYS AS
    (2048 + length(CAST(parameters AS BLOB)) + length(CAST(needs AS BLOB)) + length(CAST(labels AS BLOB))
     + length(CAST(coalesce(external_id, '') AS BLOB)) + length(CAST(coalesce(webhook, '') AS BLOB))
     + length(CAST(coalesce(source, '') AS BLOB)) + length(CAST(coalesce(send, '') AS BLOB))) VIRTUAL;
CREATE INDEX jobs_by_size ON jobs (tenant, bytes);

-- The key that made a key over HTTP, '' if its maker had none; NULL if the operator made it.
ALTER TABLE api_keys ADD COLUMN maker TEXT;
